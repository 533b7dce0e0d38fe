"""`OwnModel`: a right-hand side and a few names, and all that a sweep does follows."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.errors import BadInput
from chimera_hpc.models.custom import OwnModel, Parameter
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

MODULE = """
import numba
import numpy as np
from chimera_hpc.models.custom import Limit, OwnModel, Parameter

{before}

def rhs({arguments}):
    n, reach = ints[0], ints[1]
    for lane in range(y.shape[1]):
        for i in range(n):
            j = (i + reach) % n
            dy[i, lane] = p[0, {lane}] * y[n + i, lane] {more}
            {line}
            pull = y[n + j, lane] - y[n + i, lane]
            dy[n + i, lane] = -p[0, lane] * y[i, lane] + p[1, lane] * pull

def initial(rng, row, n_nodes):
    return {initial}

MODEL = OwnModel(
    rhs,
    variables=("x", "y"),
    parameters=(
        Parameter("omega", float, 6.0, "Frequency."),
        Parameter("gain", float, 0.02, "Coupling."),
        Parameter("reach", int, 1, "To which neighbour.", low=1),
    ),
    n_nodes=8,
    initial=initial,
    limits=(Limit("reach", (), lambda columns, n: n - 1, "reach must be below n_nodes"),),
    {options}
)
"""
PARTS = {
    "before": "",
    "arguments": "y, dy, p, ints",
    "lane": "lane",
    "more": "",
    "line": "",
    "initial": "rng.uniform(-1.0, 1.0, (2, n_nodes))",
    "options": "",
}
JOB = SMALL | {
    "name": "mine",
    "grid.P": None,
    "grid.Q": None,
    "grid.omega": [5.0, 6.0],
    "grid.gain": [0.02, 0.05],
    "grid.seeds": 4,
    "fixed.n_nodes": None,
    "integrator.t_end": 20.0,
    "integrator.t_step": 0.02,
    "features.start": 5.0,
    "features.n_peaks": 4,
    "features.groups": 2,
    "run.block": None,
    "reduction.show": ["omega=5 gain=0.02 seed=1"],
}


def write(folder: Path, module: str, **parts: str) -> Path:
    """Write a module and a job beside it."""
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(MODULE.format(**PARTS | parts))
    job = folder / "job.toml"
    job.write_text(job_text(JOB, {"model": f"{module}:MODEL"}))
    return job


@pytest.fixture
def apart(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Leave sys.path and the modules as they were."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    before = set(sys.modules)
    yield
    for name in set(sys.modules) - before:
        if name.startswith("mine_"):
            del sys.modules[name]


def run(cwd: Path, *words: object) -> subprocess.CompletedProcess[str]:
    """Run a command line in a process and a folder of its own."""
    command = [sys.executable, "-m", "chimera_hpc.sweep", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=dict(os.environ))


def bits(folder: Path) -> tuple[bytes, bytes]:
    store = Store.open(folder / "store.zarr")
    table = np.stack(list(store.scalars().values()))
    return store.features().tobytes(), table.tobytes()


def test_rows_are_variables_node_by_node_and_parameters_come_as_documented(apart: None) -> None:
    def rhs(y, dy, p, ints):
        dy[:] = 0.0

    model = OwnModel(
        rhs,
        variables=("x", "y", "z"),
        parameters=(
            Parameter("a", float, 1.0, "A real number."),
            Parameter("k", int, 2, "An integer."),
            Parameter("b", float, 3.0, "Another."),
        ),
        n_nodes=4,
        observed=("z", "x"),
    )

    class Sweep:
        model, n_nodes = "module:model", 4

    point = model.build(Sweep(), {"a": 1.5, "k": 7, "b": 2.5, "seed": 0, "delta": 0.1})
    assert point.lane_params.tolist() == [1.5, 2.5]
    assert point.int_params.tolist() == [4, 7]
    assert point.n_rows == 12
    rows = np.arange(12.0)[:, None]
    u, w = point.node_pair(rows)
    assert u.ravel().tolist() == [8.0, 9.0, 10.0, 11.0]
    assert w.ravel().tolist() == [0.0, 1.0, 2.0, 3.0]
    assert point.state(rows[:4, 0], rows[4:, 0]).tolist() == rows.ravel().tolist()


@pytest.mark.slow
def test_plan_run_and_looking_at_it_work_from_any_folder(apart: None, tmp_path: Path) -> None:
    job = write(tmp_path / "jobs", "mine_anywhere")
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    done = run(elsewhere, "run", job, "--out", out, "--cluster", "serial")
    assert done.returncode == 0, done.stderr
    assert (out / "figures" / "space_time.png").is_file()
    assert json.loads((out / "results.json").read_text())["points"]["total"] == 16
    for words in (("status", out), ("verify", out, "--sample", "0.2"), ("why", out, "seed=1")):
        done = run(elsewhere, *words)
        assert done.returncode == 0, done.stderr
    assert Store.open(out / "store.zarr").metadata["attributes"]["model_folder"] == str(job.parent)


@pytest.mark.slow
def test_every_executor_leaves_the_same_bits(apart: None, tmp_path: Path) -> None:
    job = write(tmp_path, "mine_bits")
    common = ("--no-figures",)
    serial = ("--cluster", "serial", "--block", "1")
    assert main(["run", str(job), "--out", str(tmp_path / "one"), *serial, *common]) == 0
    wanted = bits(tmp_path / "one")
    workers = ("--workers", "2", "--block", "8")
    assert main(["run", str(job), "--out", str(tmp_path / "dask"), *workers, *common]) == 0
    assert bits(tmp_path / "dask") == wanted
    shared = ["shard", str(job), "--out", str(tmp_path / "shard"), "--of", "2"]
    for index in "01":
        done = run(Path("/"), *shared, "--index", index)
        assert done.returncode == 0, done.stderr
    assert bits(tmp_path / "shard") == wanted


@pytest.mark.slow
def test_results_follow_an_edit_of_the_model(apart: None, tmp_path: Path) -> None:
    words = ("--cluster", "serial", "--no-figures")
    job = write(tmp_path, "mine_edited", before="SIGN = 1.0", more="* SIGN")
    assert run(tmp_path, "run", job, "--out", tmp_path / "a", *words).returncode == 0
    source = tmp_path / "mine_edited.py"
    then = source.stat()
    source.write_text(source.read_text().replace("SIGN = 1.0", "SIGN = 0.9"))
    # As an editor or a copy may leave it: the same size and the same date.
    os.utime(source, ns=(then.st_atime_ns, then.st_mtime_ns))
    assert source.stat().st_size == then.st_size
    assert run(tmp_path, "run", job, "--out", tmp_path / "b", *words).returncode == 0
    before, after = (Store.open(tmp_path / x / "store.zarr").features() for x in "ab")
    # x' = s omega y, y' = -omega x + ...: the frequency is omega sqrt(s) / 2 pi.
    ratio = np.nanmedian(after[:, 1]) / np.nanmedian(before[:, 1])
    assert ratio == pytest.approx(0.9**0.5, rel=2e-3)
    done = run(tmp_path, "verify", tmp_path / "a", "--sample", "0.1")
    assert done.returncode == 1
    assert "model: mine_edited:MODEL, source " in done.stdout
    assert not list(tmp_path.rglob("mine_edited*.pyc"))
    assert not list(tmp_path.rglob("mine_edited*.nb?"))


def test_edit_of_a_module_beside_it_is_seen_in_the_record(apart: None, tmp_path: Path) -> None:
    from chimera_hpc.job import Sweep
    from chimera_hpc.job.shipped import job_file
    from chimera_hpc.store.provenance import model_source

    (tmp_path / "mine_helper.py").write_text("FACTOR = 1.0\n")
    job = write(tmp_path, "mine_source", before="import mine_helper")
    model = Sweep.load(job)
    before = model_source(model)
    assert before == model_source(model)
    (tmp_path / "mine_helper.py").write_text("FACTOR = 2.0\n")
    assert model_source(model) != before
    assert model_source(Sweep.load(job_file("quickstart"))) == {}


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"arguments": "t, y, dy, p, ints"}, "takes (t, y, dy, p, ints) where (y, dy, p, ints)"),
        ({"arguments": "y, dy, p, ints=0"}, "takes (y, dy, p, ints=0) where (y, dy, p, ints)"),
        ({"more": "+ nothing_like_this"}, "does not compile: TypingError: "),
        ({"more": "+ nothing_like_this"}, "nothing_like_this"),
        ({"line": "z = np.zeros(3); dy[i, lane] += z[0]"}, "does not compile: "),
        ({"lane": "0"}, "gives a run other numbers next to others than alone"),
        ({"line": "y[i, lane] = 0.5"}, "changes the state y"),
        ({"line": "continue"}, "not finite in the initial state, or not set, in row 8"),
        ({"more": "+ np.log(-1.0)"}, "not finite in the initial state, or not set, in row 0"),
        # In the first of the tried lanes only: the others have slightly larger parameters.
        ({"more": "+ np.log(p[1, lane] - 0.02)"}, "not finite in the initial state, or not set"),
        ({"initial": "rng.uniform(-1.0, 1.0, n_nodes)"}, "initial gives (8,) where"),
        ({"initial": "np.full((2, n_nodes), np.inf)"}, "the initial state is not finite"),
        ({"initial": "1 / 0"}, "does not work: ZeroDivisionError: division by zero"),
        ({"options": "reals=lambda row, n_nodes: 'no'"}, "reals must be a list of finite real"),
        ({"options": "integers=lambda row, n_nodes: [0.5]"}, "integers must be a list of finite"),
        ({"options": "observed='z',"}, "observed: 'z' is none of x, y"),
        ({"options": "observed=lambda state: (state[0, :3], state[1])"}, "node_pair(rows)[0] is"),
        (
            {"before": "@numba.njit(cache=True)\ndef f(x):\n    return x\n", "more": "+ f(0.0)"},
            "calls f, which is compiled with cache=True",
        ),
    ],
    ids=lambda value: str(value)[:40],
)
def test_what_is_wrong_is_said_on_one_line_when_it_is_planned(
    parts: dict[str, str],
    message: str,
    apart: None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    module = f"mine_{abs(hash((str(parts), message)))}"
    assert main(["plan", str(write(tmp_path, module, **parts))]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert f"model: '{module}:MODEL'" in error
    assert error.count("\n") == 1


def test_bounds_of_parameters_hold_as_for_other_models(
    apart: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = str(write(tmp_path, "mine_bounds"))
    assert main(["plan", job, "--set", "reach=8"]) == 2
    assert "reach: 8 is too large, at most 7 is allowed" in capsys.readouterr().err
    assert main(["plan", job, "--set", "reach=0"]) == 2
    assert "reach: 0 is not an integer from 1" in capsys.readouterr().err
    assert main(["plan", job, "--set", "gains=0.5"]) == 2
    assert "did you mean gain?" in capsys.readouterr().err
    assert main(["plan", job, "--set", "reduction.show=['P=3']"]) == 2
    assert "unknown 'P'" in capsys.readouterr().err


def test_missing_module_is_said_with_where_it_may_be(
    apart: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = tmp_path / "job.toml"
    job.write_text(job_text(JOB, {"model": "mine_missing:MODEL"}))
    assert main(["plan", str(job)]) == 2
    error = capsys.readouterr().err
    assert "No module named 'mine_missing'" in error
    assert "job's folder, the current one, or on PYTHONPATH" in error


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"variables": ()}, "at least one"),
        ({"variables": ("x", "x")}, "different names are needed"),
        ({"parameters": (Parameter("seed", int, 0, "Mine."),)}, "every sweep has that already"),
        ({"initial": lambda rng: None}, r"initial takes \(rng\) where"),
        ({"reals": 3}, "reals: a function"),
    ],
)
def test_wrong_definition_is_refused_where_it_stands(
    change: dict[str, object], message: str
) -> None:
    def rhs(y, dy, p, ints):
        dy[:] = 0.0

    make: Callable[..., OwnModel] = OwnModel
    with pytest.raises(BadInput, match=message):
        make(rhs, **{"variables": ("x",)} | change)
