"""Chains: the same bits by every executor, after a kill and a retry; first states from a file."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.plot.hysteresis import hysteresis
from chimera_hpc.reduction.chains import chain_lines
from chimera_hpc.reduction.results import read_results
from chimera_hpc.run.block import run_block
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

B = [0.5, 0.3, 0.4, 0.6, 0.45]
JOB = SMALL | {
    "name": "chains",
    "grid.P": [2, 3],
    "grid.Q": None,
    "grid.b": B,
    "grid.seeds": 1,
    "fixed.Q": 2,
    "integrator.t_end": 100.0,
    "features.start": 70.0,
    "run.block": None,
    "continue.along": "b",
    "continue.direction": "both",
    "continue.settle": 10.0,
}
SLOW_WRITES = (
    "import sys; from chimera_hpc.run import chain; chain.LEAST_SECONDS = 0.0; "
    "from chimera_hpc.sweep import main; sys.exit(main(sys.argv[1:]))"
)


def write_job(folder, **changes):
    folder.mkdir(exist_ok=True)
    job = folder / "chains.toml"
    job.write_text(job_text(JOB, {key.replace("__", "."): x for key, x in changes.items()}))
    return job


def run(job, out, *options):
    return main(["run", str(job), "--out", str(out), "--no-figures", *options])


def open_store(folder):
    return Store.open(folder / "store.zarr")


def contents(folder):
    store = open_store(folder)
    states = [store.files.read("state", block) for block in range(store.n_blocks)]
    return store.ledger(), store.features(), np.concatenate(states)


def assert_same(folder, reference):
    (ledger, *arrays), (expected, *others) = contents(folder), reference
    for array, other in zip(arrays, others, strict=True):
        assert array.tobytes() == other.tobytes()
    for name in ("status", "steps", "n_windows", "digest"):
        assert (ledger[name] == expected[name]).all(), name


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    folder = tmp_path_factory.mktemp("serial")
    assert run(write_job(folder), folder / "out", "--cluster", "serial") == 0
    return folder / "out"


def test_a_chain_is_a_block_there_and_back(serial):
    store = open_store(serial)
    assert (store.n_blocks, store.block_size) == (2, 10)
    columns = store.points.columns
    there = sorted(B)
    assert columns["b"].tolist() == 2 * (there + there[::-1])
    assert columns["direction"].tolist() == 2 * (5 * [1] + 5 * [-1])
    assert store.points.axes == ("P", "b", "direction", "seed")
    assert (store.ledger()["status"] == Status.DONE).all()


def test_each_point_starts_from_the_state_before(serial):
    """The state behind point 3 is where a single run from the state behind point 2 ends."""
    store = open_store(serial)
    states = store.files.read("state", 0)
    assert np.isnan(store.starts([0])).all()
    alone = run_block(store.sweep, store.points[[3]], starts=states[[2]])
    assert alone.state.tobytes() == states[[3]].tobytes()
    own = run_block(store.sweep, store.points[[3]])
    assert own.state.tobytes() != states[[3]].tobytes()


def test_the_first_point_is_that_of_a_sweep_without_chains(serial, tmp_path):
    store = open_store(serial)
    data = store.sweep.to_dict()
    settle = data.pop("continue")["settle"]
    data["integrator"]["t_end"] += settle
    data["features"]["start"] += settle
    data["grid"]["b"] = [min(B)]
    plain = Sweep.from_dict(data)
    first = run_block(plain, plain.points()[:1])
    assert np.allclose(first.features[0], store.features()[0], rtol=1e-6, atol=1e-9)


def test_dask_leaves_the_bits_of_the_serial_run(serial, tmp_path):
    assert run(write_job(tmp_path), tmp_path / "out", "--workers", "2") == 0
    assert_same(tmp_path / "out", contents(serial))


@pytest.mark.slow
def test_a_chain_that_was_killed_goes_on_to_the_same_bits(serial, tmp_path):
    job, out = write_job(tmp_path), tmp_path / "out"
    options = ("run", str(job), "--out", str(out), "--no-figures", "--cluster", "serial")
    command = [sys.executable, "-c", SLOW_WRITES, *options]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
    ledger = out / "store.zarr" / "ledger" / "c.0.0"
    while not ledger.exists():
        assert process.poll() is None
        time.sleep(0.002)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    done = int(np.count_nonzero(open_store(out).ledger()["status"] != Status.NEVER))
    assert 0 < done < 10
    assert main([*options]) == 0
    assert_same(out, contents(serial))
    steps = open_store(out).ledger()
    assert (steps["run"][:done] == 1).all()
    assert (steps["run"][done:] == 2).all()


def test_recomputed_points_are_those_of_the_store(serial, capsys):
    assert main(["verify", str(serial), "--sample", "1"]) == 0
    assert "20 of 20 points recomputed, 0 different" in capsys.readouterr().out


def test_results_hold_chains_and_their_thresholds(serial, tmp_path):
    results = read_results(serial / "results.json")
    store = open_store(serial)
    chains = results["chains"]
    assert [(chain["P"], chain["direction"]) for chain in chains] == [
        (2, "forward"),
        (2, "backward"),
        (3, "forward"),
        (3, "backward"),
    ]
    assert chains[1]["values"] == sorted(B, reverse=True)
    order = store.scalars()["order_parameter"]
    assert chains[1]["order"] == order[5:10].tolist()
    assert all(len(chain["classes"]) == 5 for chain in chains)
    (first, _) = results["hysteresis"]
    assert (first["P"], first["along"], first["order"]) == (2, "b", "order_parameter")
    assert first["backward"]["step"]["interval"] == chains[1]["step"]["interval"]
    assert chain_lines(results)[0].startswith("P = 2: b forward: ")
    figure = hysteresis(chains, results["hysteresis"])
    assert [axes.get_title() for axes in figure.axes[:2]] == ["P = 2", "P = 3"]


@pytest.mark.slow
def test_an_extension_adds_whole_chains(serial, tmp_path, capsys):
    job, out = write_job(tmp_path, grid__P=[3]), tmp_path / "out"
    assert run(job, out, "--cluster", "serial") == 0
    assert main(["extend", str(out), "--set", "P=[2, 3]"]) == 0
    assert main(["run", str(out), "--no-figures", "--cluster", "serial"]) == 0
    digests = [open_store(folder).ledger()["digest"].reshape(2, -1) for folder in (out, serial)]
    assert (digests[0] == digests[1][::-1]).all()
    capsys.readouterr()
    assert main(["extend", str(out), "--set", "b=[0.3, 0.4, 0.45, 0.5, 0.6, 0.7]"]) == 2
    assert "not the axis of the chains" in capsys.readouterr().err


@pytest.mark.slow
def test_points_behind_a_failed_one_are_not_started_until_it_is_done(tmp_path, capsys):
    changes = {
        "grid__P": [2],
        "grid__b": None,
        "grid__epsilon": [0.1, 0.005, 0.003],
        "fixed__b": 0.5,
        "continue__along": "epsilon",
        "continue__direction": "backward",
        "integrator__max_steps": 4000,
    }
    job, out = write_job(tmp_path, **changes), tmp_path / "out"
    run(job, out, "--cluster", "serial")
    assert open_store(out).ledger()["status"].tolist() == [
        Status.DONE,
        Status.STEP_BUDGET,
        Status.NOT_STARTED,
    ]
    main(["status", str(out)])
    assert "a point before it in its chain failed" in capsys.readouterr().out
    options = ("--max-steps", "1000000", "--no-figures", "--cluster", "serial")
    assert main(["retry", str(out), "--status", "step_budget", *options]) == 0
    assert "3 of 3 points" in capsys.readouterr().err
    assert (open_store(out).ledger()["status"] <= Status.NO_WINDOW).all()
    whole = write_job(tmp_path, **changes | {"integrator__max_steps": 1000000})
    assert run(whole, tmp_path / "whole", "--cluster", "serial") == 0
    digests = [open_store(folder).ledger()["digest"] for folder in (out, tmp_path / "whole")]
    assert (digests[0] == digests[1]).all()


@pytest.mark.slow
def test_first_states_come_from_a_file(tmp_path):
    sizes = {"u": 12, "v": 24}
    rng = np.random.default_rng(1)
    given = {name: rng.uniform(-1, 1, (2, size)) for name, size in sizes.items()}
    np.savez(tmp_path / "first.npz", **given)
    changes = {"grid__P": [2], "grid__seeds": 2, "integrator__initial": "first.npz"}
    job, out = write_job(tmp_path, **changes), tmp_path / "out"
    assert run(job, out, "--cluster", "serial") == 0
    store = open_store(out)
    for seed in (0, 1):
        start = np.concatenate([given["u"][seed], given["v"][seed]])[None]
        (point,) = store.points.find(seed=seed, b=0.3, direction=1)
        again = run_block(store.sweep, store.points[[point]], starts=start)
        assert again.state[0].tobytes() == store.starts([point + 1])[0].tobytes()
    np.savez(tmp_path / "first.npz", **{name: 2 * array for name, array in given.items()})
    assert Sweep.load(job).digest != store.sweep.digest


@pytest.mark.parametrize(
    ("arrays", "line"),
    [
        ({"u": np.zeros(11), "v": np.zeros(24)}, "u has 11 values per state, this model has 12"),
        ({"u": np.zeros(12)}, "v has 0 values per state, this model has 24"),
        ({"u": np.zeros((1, 12)), "v": np.zeros((2, 24))}, "none for seed 2: row s is for seed s"),
        ({"u": np.zeros((1, 12)), "v": np.zeros((4, 24))}, "v has 4 rows, none for seed 4"),
        ({"u": np.full(12, np.nan), "v": np.zeros(24)}, "u holds values that are not finite"),
        ({"w": np.zeros(12)}, "unknown array 'w'"),
        ({"v": np.zeros(12)}, "no array u"),
        ({"u": np.zeros(12), "phase": np.zeros(12)}, "two names of the same array"),
        ({"u": np.zeros((1, 2, 12))}, "real numbers of shape"),
        ({"u": np.array(["a"])}, "real numbers of shape"),
        (None, "not a NumPy file .npz"),
        ("", "No such file"),
    ],
)
def test_files_that_do_not_fit_are_one_line(arrays, line, tmp_path, capsys):
    if arrays is None:
        (tmp_path / "first.npz").write_text("u")
    elif arrays:
        np.savez(tmp_path / "first.npz", **arrays)
    changes = {"grid__P": [2], "grid__seeds": [2, 4], "integrator__initial": "first.npz"}
    assert main(["plan", str(write_job(tmp_path, **changes))]) == 2
    error = capsys.readouterr().err
    assert line in error
    assert "integrator.initial" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"continue__along": "B"}, "continue.along: 'B' is not an axis of [grid]"),
        ({"continue__along": "seeds"}, "it only moves first states"),
        ({"continue__along": "c"}, "has one value; a chain needs at least 2"),
        ({"continue__along": None}, "continue.along: missing"),
        ({"continue__direction": "up"}, "continue.direction"),
        ({"continue__settle": -1.0}, "continue.settle"),
        ({"continue__initial": "x.npz"}, "it belongs in [integrator]"),
        ({"continue__along": "P"}, "a state of 36 variables cannot be continued"),
        ({"continue__along": "P", "grid__Q": "0:P", "fixed__Q": None}, "the axis Q depends on it"),
        ({"continue__along": "Q", "grid__Q": "P", "fixed__Q": None}, "depends on another axis"),
        ({"run__block": 4}, "run.block: 4, but with [continue] a chain is a block"),
        ({"reduction__order": "R"}, "reduction.order: 'R' is no scalar of this sweep"),
        ({"decide__most": 10, "grid__seeds": None}, "decide: not with [continue]"),
        ({"reduction__replay": ["P=2"]}, "reduction.replay: with [continue]"),
    ],
)
def test_tables_that_make_no_chains_are_one_line(changes, line, tmp_path, capsys):
    assert main(["plan", str(write_job(tmp_path, **changes))]) == 2
    error = capsys.readouterr().err
    assert line in error
    assert error.count("\n") == 1


def test_a_plan_names_the_chains(tmp_path, capsys):
    assert main(["plan", str(write_job(tmp_path))]) == 0
    assert "chains      2 of 10 points along b, both ways" in capsys.readouterr().out
