"""The bookkeeping of large sweeps; ``scripts/scale`` prints all of its measurements."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from programs import SCALE, load_program

from chimera_hpc.base.status import Status
from chimera_hpc.job import Points, Sweep
from chimera_hpc.run import work
from chimera_hpc.run.messages import RunMessage
from chimera_hpc.run.work import do_block
from chimera_hpc.store.block_result import BlockResult, failed_block
from chimera_hpc.store.ledger import FIELDS, chunk_name, seal
from chimera_hpc.store.store import Store

MILLION = 1_000_000


@pytest.fixture(scope="module")
def scale() -> ModuleType:
    """The program behind scripts/scale."""
    return load_program(SCALE, "scale_measurements")


def write_ledger(store: Store) -> None:
    """Have every point look done."""
    table = np.zeros((store.block_size, len(FIELDS)), dtype="<i8")
    table[:, :2] = 1
    data = seal(table.tobytes())
    for block in range(store.n_blocks):
        (store.path / "ledger" / chunk_name(block, 2)).write_bytes(data)


@pytest.mark.slow
def test_million_points_are_planned_in_seconds_and_looked_at_in_one(
    scale: ModuleType, tmp_path: Path
) -> None:
    planned = scale.plan(tmp_path, "large", MILLION)
    assert planned.seconds < 15
    assert planned.memory < 1e9
    store = Store.open(planned.path)
    assert store.n_points == MILLION
    write_ledger(store)
    before = os.times()
    looked = scale.run("-m", "chimera_hpc.sweep", "status", planned.path, "--json")
    after = os.times()
    assert f'"done": {MILLION}' in looked.text
    # Time on the processor, so that a busy machine does not count.
    spent = after.children_user + after.children_system
    assert spent - before.children_user - before.children_system < 1.5


def test_files_are_five_per_block_and_few_others(
    scale: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(sweep: Sweep, points: Points, should_stop: object) -> BlockResult:
        return failed_block(sweep, points, Status.DONE)

    monkeypatch.setattr(work, "run_block", nothing)
    job = tmp_path / "job.toml"
    job.write_text(
        scale.JOB.format(values=2)
        .replace('series = "none"', 'series = "all"')
        .replace("seeds = 1000", "seeds = 6\n[fixed]\nn_nodes = 25\n[features]\nstart = 990.0")
        .replace("block = 300", "block = 4")
    )
    store = Store.plan(tmp_path / "store.zarr", Sweep.load(job))
    empty = count_files(store.path)
    for block in range(store.n_blocks):
        do_block(RunMessage(store.path, 1), block)
    assert store.n_blocks == 30
    assert empty < 100
    assert count_files(store.path) - empty == 5 * store.n_blocks


@pytest.mark.slow
def test_export_of_series_takes_less_memory_than_the_series(
    scale: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(work, "run_block", work.run_block)  # set by the program
    line = scale.export_memory(tmp_path, n_seeds=36)
    assert "export of 360 MB of series" in line.what
    assert line.good, line.words()


def test_first_estimate_is_compared_with_the_time_that_was_left(scale: ModuleType) -> None:
    log = [
        "2026-01-01T00:00:00+00:00 run 1: 3 of 3 blocks to do",
        "2026-01-01T00:00:10+00:00 1 of 3 points, 0.1 points/s, elapsed 00:00:10, ETA 00:01:30",
        "2026-01-01T00:00:30+00:00 2 of 3 points, 0.1 points/s, elapsed 00:00:30, ETA 00:00:10",
        "2026-01-01T00:00:40+00:00 3 of 3 points, 0.1 points/s, elapsed 00:00:40, ETA 00:00:00",
    ]
    estimate: Callable[..., float] = scale.large.first_estimate
    assert estimate(log) == 3.0


def count_files(folder: Path) -> int:
    return sum(len(files) for _, _, files in os.walk(folder))


@pytest.mark.parametrize(
    ("value", "limit", "at_least", "good"),
    [(1.0, 2.0, False, True), (3.0, 2.0, False, False), (3.0, 2.0, True, True)],
)
def test_table_says_whether_a_limit_is_held(
    value: float, limit: float, at_least: bool, good: bool, scale: ModuleType
) -> None:
    line = scale.Line("something", value, "s", limit, at_least)
    assert line.good == good
    table: Callable[..., str] = scale.table
    assert f"{'>=' if at_least else '<='} {limit:g} s" in table([line])
