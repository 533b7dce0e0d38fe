"""Writing blocks: the ledger last, finished rows untouched, whatever is late or killed."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from store_tools import (
    block_results,
    fill,
    make_store,
    process_context,
    results,
    work,
)

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import BlockFiles
from chimera_hpc.store.claims import Claim, ClaimLost, claim_block
from chimera_hpc.store.ledger import digests
from chimera_hpc.store.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return make_store(tmp_path)


def rows_of(store: Store, block: int) -> dict[str, np.ndarray[Any, Any]]:
    return {name: store.files.read(name, block) for name in store.files.shapes}


def test_what_is_written_is_read_back(store: Store) -> None:
    fill(store)
    wanted = results(store, range(15))
    np.testing.assert_array_equal(store.features(), wanted.features)
    scalars = store.scalars()
    assert list(scalars)[:3] == ["V_theta", "V_a", "V_Omega"]
    np.testing.assert_array_equal(np.stack(list(scalars.values()), axis=1), wanted.scalars)
    ledger = store.ledger()
    np.testing.assert_array_equal(ledger["digest"], digests(wanted.features, wanted.scalars))
    np.testing.assert_array_equal(ledger["steps"], wanted.steps)
    assert wanted.series is not None
    for point in (0, 7, 14):
        np.testing.assert_allclose(store.series(point), wanted.series[point] * 1e-4, atol=1e-12)


def test_receipt_counts_what_was_written(store: Store) -> None:
    made = block_results(store, 0)
    made.status[:] = [Status.DONE, Status.STEADY, Status.TIME_OUT, Status.NEVER]
    receipt = store.write_block(0, made, 1, 1)
    assert (receipt.block, receipt.n_done, receipt.n_failed) == (0, 2, 1)
    files = [store.files.file(name, 0) for name in store.files.shapes]
    assert receipt.bytes == sum(path.stat().st_size for path in files)


def test_chunks_appear_in_order_the_ledger_last(store: Store, monkeypatch: Any) -> None:
    renamed, synced = [], []
    replace, fsync = os.replace, os.fsync

    def watch(source: Path, target: Path) -> None:
        flushed = {os.stat(source).st_ino} <= set(synced)
        renamed.append((Path(target).parent.name, flushed))
        replace(source, target)

    def note(descriptor: int) -> None:
        synced.append(os.fstat(descriptor).st_ino)
        fsync(descriptor)

    monkeypatch.setattr(os, "replace", watch)
    monkeypatch.setattr(os, "fsync", note)
    store.write_block(2, block_results(store, 2), 1, 1)
    assert renamed == [(n, True) for n in ("u", "features", "scalars", "quality", "ledger")]
    folders = {name: (store.path / name).stat().st_ino for name in store.files.shapes}
    assert synced.index(folders["features"]) < synced.index(folders["ledger"])
    assert synced[-1] == folders["ledger"]


def test_data_chunks_without_the_ledgers_are_no_results(store: Store, monkeypatch: Any) -> None:
    replace = os.replace

    def dying(source: Path, target: Path) -> None:
        if Path(target).parent.name == "ledger":
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(os, "replace", dying)
    with pytest.raises(OSError, match="No space"):
        store.write_block(0, block_results(store, 0), 1, 1)
    monkeypatch.undo()
    assert store.pending() == [0, 1, 2, 3]
    assert np.isnan(store.features()).all()
    assert [p for p in store.path.rglob(".*.partial")] == []


def test_rows_whose_ledger_was_not_reached_are_no_results(store: Store, monkeypatch: Any) -> None:
    store.write_block(0, results(store, [0]), 1, 1, rows=[0])
    write = BlockFiles.write

    def dying(files: BlockFiles, block: int, chunks: Any) -> int:
        if "ledger" in chunks:
            raise InterruptedError
        return write(files, block, chunks)

    monkeypatch.setattr(BlockFiles, "write", dying)
    with pytest.raises(InterruptedError):
        store.write_block(0, results(store, [1]), 1, 1, rows=[1])
    assert np.isfinite(store.files.read("features", 0)[1]).all()
    assert np.isfinite(store.features()[0]).all()
    assert np.isnan(store.features()[1]).all()
    assert np.isnan(store.scalars()["V_theta"][1])
    assert store.find_damaged(deep=True) == []


def test_block_taken_over_meanwhile_is_not_entered_into_the_ledger(store: Store) -> None:
    claim = claim_block(store.path, 1, 1)
    assert claim is not None
    answers = [True, False]
    claim.still_mine = lambda: answers.pop(0)  # type: ignore[method-assign]
    with pytest.raises(ClaimLost, match="block 1 was taken over"):
        store.write_block(1, block_results(store, 1), 1, 1, claim)
    assert store.pending() == [0, 1, 2, 3]
    assert answers == [], "asked before the data and again before the ledger"


def test_all_fill_chunks_are_written_too(store: Store) -> None:
    store.write_block(0, block_results(store, 0, Status.NON_FINITE), 1, 1)
    for name in store.files.shapes:
        assert store.files.file(name, 0).exists()
    assert store.find_damaged(deep=True) == []


def test_block_without_any_series_still_has_its_shard(tmp_path: Path) -> None:
    store = make_store(tmp_path, "keep.series=first-seed")
    fill(store)
    no_first = store.files.file("u", 2)
    assert store.points.columns["seed"][8:12].min() > 0 or no_first.exists()
    assert store.find_damaged(deep=True) == []
    with xr.open_zarr(store.path, chunks=None) as data:
        kept = ~np.isnan(data.u.values).all(axis=(1, 2))
    np.testing.assert_array_equal(kept, store.points.columns["seed"] == 0)
    assert np.isfinite(store.series(5)).all()
    with pytest.raises(ValueError, match="series of point 6 is not kept"):
        store.series(6)


@pytest.mark.parametrize("dtype", ["int16", "float32"])
def test_values_beyond_the_range_are_missing_only_in_int16(tmp_path: Path, dtype: str) -> None:
    from store_tools import encode_series

    store = make_store(tmp_path, f"keep.dtype={dtype}")
    made = block_results(store, 0)
    u = np.zeros((4, 21, 12))
    u[0, 0, :6] = 3.2767, -3.2767, 3.27676, -3.27676, np.nan, np.inf
    made.series = encode_series(u, dtype)
    store.write_block(0, made, 1, 1)
    found = store.series(0)[0, :6]
    with xr.open_zarr(store.path, chunks=None) as data:
        np.testing.assert_allclose(data.u.values[0, 0, :6], found)
    if dtype == "int16":
        np.testing.assert_allclose(found[:2], [3.2767, -3.2767])
        assert np.isnan(found[2:]).all()
    else:
        np.testing.assert_allclose(found, u[0, 0, :6], rtol=1e-7)


def test_finished_rows_stay_byte_identical_when_the_block_is_written_again(store: Store) -> None:
    made = block_results(store, 0)
    made.status[:] = [Status.DONE, Status.TIME_OUT, Status.NO_WINDOW, Status.NEVER]
    store.write_block(0, made, 1, 1)
    before = rows_of(store, 0)
    other = results(store, [9, 9, 9, 9])
    assert store.points_to_do(0).tolist() == [3]
    assert store.points_to_do(0, attempts=2).tolist() == [1, 3]
    receipt = store.write_block(0, other, 2, 1)
    after = rows_of(store, 0)
    assert (receipt.n_done, receipt.n_failed) == (2, 0)
    for name in before:
        for row in (0, 2):
            assert after[name][row].tobytes() == before[name][row].tobytes(), name
        for row in (1, 3):
            assert after[name][row].tobytes() != before[name][row].tobytes(), name


def test_results_of_some_points_go_to_their_rows(store: Store) -> None:
    store.write_block(1, results(store, [5, 7]), 1, 1, rows=[1, 3])
    assert np.flatnonzero(store.ledger()["status"] == Status.DONE).tolist() == [5, 7]
    assert store.points_to_do(1).tolist() == [0, 2]
    store.write_block(1, results(store, [4, 6]), 1, 1, rows=[0, 2])
    np.testing.assert_array_equal(store.features()[4:8], results(store, range(4, 8)).features)


@pytest.mark.parametrize("dtype", ["int16", "float32"])
def test_rows_that_did_not_run_are_missing_and_not_zero(tmp_path: Path, dtype: str) -> None:
    store = make_store(tmp_path, f"keep.dtype={dtype}")
    store.write_block(1, results(store, [5, 7]), 1, 1, rows=[1, 3])
    for point in (4, 6):
        with pytest.raises(BadInput, match=f"point {point} "):
            store.series(point)
    assert np.isnan(store.features()[[4, 6]]).all()
    assert all(np.isnan(column[[4, 6]]).all() for column in store.scalars().values())
    with xr.open_zarr(store.path, chunks=None) as data:
        for values in (data.u.values, data.features.values, data.scalars.values):
            assert np.isnan(values[[4, 6]]).all()
            assert np.isfinite(values[[5, 7]]).all()


def test_attempts_add_up_over_retries(store: Store) -> None:
    store.write_block(0, block_results(store, 0, Status.TIME_OUT), 1, attempts=2)
    store.write_block(0, results(store, [1]), 5, attempts=1, rows=[1])
    ledger = store.ledger()
    assert ledger["attempts"][:4].tolist() == [2, 3, 2, 2]
    assert ledger["run"][:4].tolist() == [1, 5, 1, 1]


def test_failures_are_pending_only_when_asked_for(store: Store) -> None:
    fill(store)
    store.discard_block(2)
    store.write_block(2, block_results(store, 2, Status.STEP_BUDGET), 1, 2)
    assert store.pending() == []
    assert store.pending(retry_failed=True) == [2]
    assert store.pending(retry_failed=True, attempts=2) == []
    assert store.pending(retry_failed=True, statuses=[Status.TIME_OUT]) == []
    counts = store.status()
    assert (counts[Status.DONE], counts[Status.STEP_BUDGET], counts[Status.NEVER]) == (11, 4, 0)


def test_last_block_may_be_partly_filled(store: Store) -> None:
    assert store.block(3) == (12, 15)
    with pytest.raises(IndexError):
        store.block(4)
    fill(store)
    assert len(store.features()) == 15
    assert store.files.read("ledger", 3)[3].tolist() == [255] * 7


def test_results_must_be_as_many_as_points(store: Store) -> None:
    with pytest.raises(ValueError, match="4 results for 3 points of block 3"):
        store.write_block(3, block_results(store, 0), 1, 1)


def test_killed_writers_leave_each_block_whole_or_pending(tmp_path: Path) -> None:
    store = make_store(tmp_path, "seeds=40", "run.block=3")
    wanted = results(store, range(store.n_points))
    context, rng = process_context(), np.random.default_rng(5)
    whole: set[int] = set()
    for trial in range(6):
        process = context.Process(target=work, args=(store.path, trial))
        process.start()
        before = len(os.listdir(store.path / "ledger"))
        while len(os.listdir(store.path / "ledger")) == before and process.is_alive():
            time.sleep(1e-4)
        time.sleep(rng.uniform(0, 0.1))
        process.kill()
        process.join()
        assert store.find_damaged(deep=True) == []
        now = set(range(store.n_blocks)) - set(store.pending())
        assert whole <= now
        whole = now
        status = store.ledger()["status"].reshape(-1, 3)
        assert ((status == Status.DONE).all(axis=1) | (status == Status.NEVER).all(axis=1)).all()
    assert whole
    work(store.path, run=99)
    np.testing.assert_array_equal(store.features(), wanted.features)
    np.testing.assert_array_equal(
        store.ledger()["digest"], digests(wanted.features, wanted.scalars)
    )
    store.repair()
    assert list(store.path.rglob(".*.partial")) == []
    assert list((store.path / "claims").iterdir()) == []


def test_racing_runners_lose_nothing_and_do_nothing_twice(tmp_path: Path) -> None:
    store = make_store(tmp_path, "seeds=20", "run.block=3")
    context = process_context()
    runners = [context.Process(target=work, args=(store.path, run, 0.01)) for run in (1, 2, 3)]
    for runner in runners:
        runner.start()
    for runner in runners:
        runner.join(timeout=60)
        assert runner.exitcode == 0
    ledger = store.ledger()
    assert (ledger["status"] == Status.DONE).all()
    assert (ledger["attempts"] == 1).all()
    assert len(set(ledger["run"].tolist())) > 1, "they shared the work"
    np.testing.assert_array_equal(store.features(), results(store, range(store.n_points)).features)
    assert store.find_damaged(deep=True) == []


def test_late_owner_changes_nothing(store: Store) -> None:
    late = block_results(store, 0)
    fill(store, run=1)
    before = {name: store.files.file(name, 0).read_bytes() for name in store.files.shapes}
    late.status[:] = Status.TIME_OUT
    receipt = store.write_block(0, late, 2, 1)
    assert (receipt.n_done, receipt.n_failed, receipt.bytes) == (0, 0, 0)
    assert before == {name: store.files.file(name, 0).read_bytes() for name in before}


def test_a_claim_of_the_right_owner_lets_him_write(store: Store) -> None:
    claim = claim_block(store.path, 0, 1)
    assert isinstance(claim, Claim)
    assert store.write_block(0, block_results(store, 0), 1, 1, claim).n_done == 4
    claim.release()


def test_a_block_without_series_is_four_files_and_no_work_of_zarr(
    tmp_path: Path, monkeypatch: Any
) -> None:
    store = make_store(tmp_path, "keep.series=none")
    made = block_results(store, 0)
    flushed = []
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda file: flushed.append(file) or fsync(file))
    monkeypatch.setattr("chimera_hpc.store.blocks.create_array", None)
    store.write_block(0, made, 1, 1)
    # Each file and the folder of each.
    assert len(flushed) == 8
