"""Rounds of a sweep with [decide]: a pure function of the store, in any process."""

from __future__ import annotations

import random
import time
from pathlib import Path

import numpy as np
import pytest
from store_tools import Result, process_context, results

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import TRIPLET
from chimera_hpc.job import Sweep
from chimera_hpc.job.points import point_keys
from chimera_hpc.run.rounds import next_round, next_sweep, standing
from chimera_hpc.store.claims import ClaimLost, claim_block
from chimera_hpc.store.merge import merge
from chimera_hpc.store.schema import scalar_labels
from chimera_hpc.store.store import Store
from chimera_hpc.store.write import Receipt

JOB = """
name = "rounds"
model = "topological_fhn"
[grid]
P = [2, 4]
Q = "P"
epsilon = [0.01, 0.04, 0.09]
[fixed]
n_nodes = 12
[integrator]
t_end = 20.0
t_step = 0.5
[features]
start = 10.0
[keep]
series = "none"
[reduction]
cuts = [2]
names = ["low", "high"]
[run]
block = 8
[decide]
first = 5
batch = 5
most = 20
refine = { epsilon = 0.02, P = 1 }
"""
THRESHOLD = {2: 0.023, 3: 0.031, 4: 0.058, 5: 0.07}


def made_up(store: Store, rows: np.ndarray) -> Result:
    """Return results whose class is low below a threshold of epsilon, and mixed near it."""
    made = results(store, rows)
    columns, names = store.points.columns, scalar_labels(store.sweep)
    for k, i in enumerate(rows.tolist()):
        epsilon, P, seed = (columns[name][i].item() for name in ("epsilon", "P", "seed"))
        random_ = np.random.default_rng([int(1e6 * epsilon), P, seed])
        is_high = random_.random() < 1 / (1 + np.exp((THRESHOLD[P] - epsilon) / 0.002))
        for name in TRIPLET:
            made.scalars[k, names.index(name)] = 0.5 * is_high + 0.1 * random_.random()
    return made


def write(store: Store, block: int, run: int = 1) -> Receipt:
    rows = store.points_to_do(block)
    made = made_up(store, store.block(block)[0] + rows)
    return store.write_block(block, made, run, 1, None, rows)


def finish(store: Store) -> Store:
    for block in store.pending():
        write(store, block)
    return store


def to_the_end(store: Store) -> Store:
    while (more := next_round(finish(store))) is not None:
        store = more
    return store


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("whole")
    return to_the_end(Store.plan(folder / "store.zarr", Sweep.from_toml_text(JOB)))


def work(path: Path) -> None:
    """Work on a store until it is at its end, next to others; for a process that gets killed."""
    store = Store.open(path)
    while True:
        for block in store.pending():
            claim = claim_block(path, block, 1, expiry=60.0)
            if claim is None:
                time.sleep(0.002)
                continue
            try:
                if len(store.points_to_do(block)):
                    write(store, block)
                claim.release()
            except ClaimLost:
                continue
        if not store.pending():
            more = next_round(store)
            if more is None:
                return
            store = more


def same(store: Store, other: Store) -> bool:
    keys = point_keys(store.points).tolist() == point_keys(other.points).tolist()
    digests = store.ledger()["digest"].tolist() == other.ledger()["digest"].tolist()
    return keys and digests and store.sweep.digest == other.sweep.digest


def test_cells_end_decided_or_with_the_most_runs(whole):
    now = standing(whole)
    assert now is not None
    assert next_sweep(whole) is None
    assert (now.found.decided | (now.runs == 20)).all()
    assert not now.open.any()
    assert (now.runs[now.found.lead > 0.95] >= 5).all()
    assert set(now.runs.tolist()) > {5}
    assert (now.cells["P"] == now.cells["Q"]).all()


def test_refined_boundaries_enclose_the_thresholds(whole):
    now = standing(whole)
    assert now is not None
    assert now.n_grid == 6
    assert set(now.cells["P"].tolist()) == {2, 3, 4}
    classes = np.array(["", *now.names])[now.classes + 1]
    for P in (2, 4):
        threshold = THRESHOLD[P]
        mine = now.cells["P"] == P
        epsilon = now.cells["epsilon"][mine]
        low = epsilon[classes[mine] == "low"].max()
        high = epsilon[classes[mine] == "high"].min()
        assert low - 0.004 < threshold < high + 0.004
        undecided = int(((classes[mine] == "") & (epsilon > low) & (epsilon < high)).sum())
        assert high - low <= 0.02 * (2 if undecided else 1) + 1e-12


@pytest.mark.slow
def test_the_points_do_not_depend_on_the_order_of_the_work(whole, tmp_path):
    store = Store.plan(tmp_path / "store.zarr", whole.sweeps[0])
    while True:
        for block in random.Random(3).sample(store.pending(), len(store.pending())):
            write(store, block)
        if len(store.sweeps) < 3:
            assert next_sweep(Store.open(store.path)) == next_sweep(store)
        more = next_round(store)
        if more is None:
            break
        stale, store = store, more
        assert next_round(stale).n_points == store.n_points  # another process was faster
    assert same(store, whole)


@pytest.mark.slow
def test_extended_and_merged_stores_go_on_with_their_rounds(whole, tmp_path):
    job = Sweep.from_toml_text(JOB, ["P=[3]"])
    other = finish(Store.plan(tmp_path / "other.zarr", job))
    merge(tmp_path / "store.zarr", [whole, other])
    merged = to_the_end(Store.open(tmp_path / "store.zarr"))
    with pytest.raises(BadInput, match="take the sweep's folder instead of its job file"):
        merged.extend(Sweep.from_toml_text(JOB, ["P=2:5"]))
    grid = {**merged.sweep.to_dict()["grid"], "P": [2, 3, 4, 5]}
    wider = Sweep.from_dict({**merged.sweep.to_dict(), "grid": grid})
    now = standing(to_the_end(merged.extend(wider)))
    assert now is not None
    assert set(now.cells["P"].tolist()) == {2, 3, 4, 5}
    assert (now.found.decided | (now.runs == 20)).all()


@pytest.mark.slow
def test_killed_at_any_moment_the_points_and_digests_are_the_same(whole, tmp_path):
    store = Store.plan(tmp_path / "store.zarr", whole.sweeps[0])
    chance = random.Random(4)
    for _ in range(5):
        crew = [process_context().Process(target=work, args=(store.path,)) for _ in range(2)]
        for process in crew:
            process.start()
        crew[0].join(chance.uniform(0.2, 1.2))
        for process in crew:
            process.kill()
            process.join()
    work(store.path)
    assert same(Store.open(store.path), whole)


def test_runs_that_oscillate_after_a_steady_first_round_are_not_overlooked(tmp_path):
    sweep = Sweep.from_toml_text(JOB, ["decide.refine={}", "decide.confidence=0.999"])
    store = Store.plan(tmp_path / "store.zarr", sweep)
    while True:
        for block in store.pending():
            rows = store.points_to_do(block)
            points = store.block(block)[0] + rows
            made, still = made_up(store, points), results(store, points, Status.STEADY)
            still.scalars[:] = np.nan
            first = store.points.columns["seed"][points] < 5
            for name in ("status", "features", "scalars", "quality"):
                getattr(made, name)[first] = getattr(still, name)[first]
            store.write_block(block, made, 1, 1, None, rows)
        more = next_round(store)
        if more is None:
            break
        store = more
    now = standing(store)
    assert now is not None
    assert now.names[0] == "unclassified"
    assert (now.found.leader == 0).all()
    assert (now.runs > 10).all()


def test_runs_that_failed_have_no_vote_and_a_cell_of_them_no_more_runs(tmp_path):
    sweep = Sweep.from_toml_text(JOB, ["decide.refine={}"])
    store = Store.plan(tmp_path / "store.zarr", sweep)
    for block in range(store.n_blocks):
        rows = np.arange(*store.block(block))
        made = made_up(store, rows)
        lost = store.points.cells()[0][rows] == 0
        bad = results(store, rows, Status.NON_FINITE)
        for name in ("status", "features", "scalars", "quality"):
            getattr(made, name)[lost] = getattr(bad, name)[lost]
        store.write_block(block, made, 1, 1)
    now = standing(store)
    assert now is not None
    assert not now.open[0]
    assert not now.found.decided[0]
    assert (now.votes[0] == 0).all()
