"""One block: what is computed, what is written, and what happens when something goes wrong."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from store_tools import small_sweep

from chimera_hpc.base.processes import process_identity
from chimera_hpc.base.status import Status
from chimera_hpc.job import Points, Sweep
from chimera_hpc.run import work
from chimera_hpc.run.messages import RetryPolicy, RunMessage
from chimera_hpc.run.work import do_block
from chimera_hpc.store.block_result import BlockResult, failed_block
from chimera_hpc.store.claims import Claim, claim_block
from chimera_hpc.store.store import Store

RUN = 1


def done(sweep: Sweep, points: Points) -> BlockResult:
    """Return results that depend on what each point is."""
    result = failed_block(sweep, points, Status.DONE)
    result.features[:] = points.columns["seed"][:, None, None]
    result.scalars[:] = points.columns["P"][:, None]
    return result


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """15 points, P = 2 to 4 with 5 seeds each, in blocks of 4."""
    return Store.plan(tmp_path / "store.zarr", small_sweep())


@pytest.fixture
def compute(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[..., BlockResult]], list[int]]:
    """Replace the integration; the list that is returned gets the sizes of the calls."""

    def replace(function: Callable[..., BlockResult]) -> list[int]:
        sizes: list[int] = []

        def run_block(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
            sizes.append(len(points))
            return function(sweep, points, should_stop)

        monkeypatch.setattr(work, "run_block", run_block)
        return sizes

    return replace


def message(store: Store, **options: Any) -> RunMessage:
    return RunMessage(store.path, options.pop("run", RUN), **options)


def status_of(store: Store) -> list[int]:
    return store.ledger()["status"][:4].tolist()


def gone(claim: Claim, driver: str = "somebody") -> None:
    """Have the claim look as if its process had died in run 1, the driver living on."""
    machine, pid, start = process_identity().split("-")
    info = json.loads(claim.path.read_bytes())
    dead = f"{machine}-{pid}-{int(start) + 1}"
    claim.path.write_text(json.dumps({**info, "process": dead, "note": {"driver": driver or dead}}))


def die(store: Store, name: int | str = 0, times: int = 1, **options: Any) -> None:
    """Leave behind the claims of processes that died at their work."""
    for _ in range(times):
        claim = claim_block(store.path, name, options.get("run", RUN))
        assert claim is not None
        gone(claim, options.get("driver", "somebody"))
        if options.get("memory"):
            claim.blame_memory()
        if options.get("hang"):
            claim.blame_model()


def is_bad(points: Points, seed: int = 2) -> bool:
    return bool((points.columns["seed"] == seed).any())


def test_block_is_computed_written_and_released(store: Store, compute: Any) -> None:
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    receipt = do_block(message(store), 0)
    assert (receipt.n_done, receipt.n_failed, receipt.error) == (4, 0, None)
    assert not receipt.stopped
    assert not receipt.taken
    assert sizes == [4]
    assert store.ledger()["attempts"][:4].tolist() == [1, 1, 1, 1]
    assert os.listdir(store.path / "claims") == []


def test_block_that_is_whole_is_not_computed_again(store: Store, compute: Any) -> None:
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store), 0)
    assert do_block(message(store, run=2), 0).n_done == 0
    assert sizes == [4]
    assert store.ledger()["run"][:4].tolist() == [1, 1, 1, 1]


def test_block_in_other_hands_is_left_alone(store: Store, compute: Any) -> None:
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    claim_block(store.path, 0, 7)
    assert do_block(message(store), 0).taken
    assert sizes == []


def test_memory_error_splits_the_block_down_to_the_point_that_fails_alone(
    store: Store, compute: Any
) -> None:
    def run(sweep: Sweep, points: Points, _: Any) -> BlockResult:
        if is_bad(points):
            raise MemoryError
        return done(sweep, points)

    sizes = compute(run)
    receipt = do_block(message(store), 0)
    assert (receipt.n_done, receipt.n_failed) == (3, 1)
    assert status_of(store) == [1, 1, Status.OUT_OF_MEMORY, 1]
    assert sizes == [4, 2, 2, 1, 1]


def test_block_that_is_too_large_together_has_no_failed_point(store: Store, compute: Any) -> None:
    def run(sweep: Sweep, points: Points, _: Any) -> BlockResult:
        if len(points) > 1:
            raise MemoryError
        return done(sweep, points)

    compute(run)
    assert do_block(message(store), 0).n_done == 4
    assert status_of(store) == [1, 1, 1, 1]


def test_error_in_a_model_is_named_and_the_other_points_are_done(
    store: Store, compute: Any
) -> None:
    def run(sweep: Sweep, points: Points, _: Any) -> BlockResult:
        if is_bad(points):
            raise ZeroDivisionError("division\nby zero")
        return done(sweep, points)

    compute(run)
    receipt = do_block(message(store), 0)
    assert receipt.error is not None
    assert receipt.error.text == "point P=2 Q=2 seed=2: ZeroDivisionError: division by zero"
    assert "Traceback" in receipt.error.trace
    assert status_of(store) == [1, 1, Status.NEVER, 1]
    compute(lambda sweep, points, _: done(sweep, points))
    assert do_block(message(store), 0).n_done == 1


def test_ctrl_c_in_the_middle_of_a_block_hands_its_claim_back(store: Store, compute: Any) -> None:
    def interrupted(sweep: Sweep, points: Points, _: Any) -> BlockResult:
        raise KeyboardInterrupt

    compute(interrupted)
    with pytest.raises(KeyboardInterrupt):
        do_block(message(store), 0)
    assert not work.is_busy()
    # This process lives on: without its word the claim would stay alive.
    claim = claim_block(store.path, 0, RUN)
    assert claim is not None
    assert [lost.handed_back for lost in claim.lost] == [True]


def test_error_of_the_system_is_told_and_the_block_handed_back(
    store: Store, compute: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    compute(lambda sweep, points, _: done(sweep, points))

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "u/c.0")

    monkeypatch.setattr(Store, "write_block", full)
    message(store).stop_file.parent.mkdir(exist_ok=True)
    receipt = do_block(message(store), 0)
    assert receipt.error is not None
    assert receipt.error.errno == errno.ENOSPC
    assert receipt.error.text == "No space left on device (u/c.0)"
    # No worker of this run begins another block.
    assert do_block(message(store), 1).stopped
    message(store).stop_file.unlink()
    monkeypatch.undo()
    compute(lambda sweep, points, _: done(sweep, points))
    assert do_block(message(store), 0).n_done == 4
    # The first try came to nothing, but its claim was handed back: no one died.
    assert store.ledger()["attempts"][:4].tolist() == [1, 1, 1, 1]


def test_nothing_is_begun_once_the_run_is_told_to_stop(store: Store, compute: Any) -> None:
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    (store.path / "runs").mkdir()
    message(store).stop_file.touch()
    assert do_block(message(store), 0).stopped
    assert do_block(message(store), 0, lambda: True).stopped
    assert sizes == []
    assert not (store.path / "claims").exists()


def test_stopped_block_keeps_what_it_has_and_is_free_at_once(store: Store, compute: Any) -> None:
    asked = False

    def run(sweep: Sweep, points: Points, should_stop: Callable[[], bool]) -> BlockResult:
        nonlocal asked
        asked = True
        assert should_stop()
        result = done(sweep, points)
        result.status[2:] = Status.NEVER
        return result

    compute(run)
    receipt = do_block(message(store), 0, lambda: asked)
    assert receipt.stopped
    assert receipt.n_done == 2
    assert status_of(store) == [1, 1, Status.NEVER, Status.NEVER]
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    assert do_block(message(store, run=2), 0).n_done == 2
    assert sizes == [2]
    ledger = store.ledger()
    assert ledger["run"][:4].tolist() == [1, 1, 2, 2]
    assert ledger["attempts"][:4].tolist() == [1, 1, 1, 1]


def test_owner_that_lost_its_claim_writes_nothing(store: Store, compute: Any) -> None:
    def run(sweep: Sweep, points: Points, should_stop: Callable[[], bool]) -> BlockResult:
        mine = store.path / "claims" / "0.1.json"
        os.utime(mine, (1e9, 1e9))
        assert claim_block(store.path, 0, 2) is not None
        return done(sweep, points)

    compute(run)
    assert do_block(message(store), 0).taken
    assert status_of(store) == [Status.NEVER] * 4


def test_one_death_is_no_reason_to_split(store: Store, compute: Any) -> None:
    die(store)
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store), 0)
    assert sizes == [4]
    assert store.ledger()["attempts"][:4].tolist() == [2, 2, 2, 2]


def test_point_that_kills_its_workers_is_found_and_put_aside(store: Store, compute: Any) -> None:
    die(store, times=2)
    die(store, "0_2", times=2)
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    receipt = do_block(message(store), 0)
    assert (receipt.n_done, receipt.n_failed) == (3, 1)
    assert sizes == [1, 1, 1]
    assert status_of(store) == [1, 1, Status.WORKER_LOST, 1]
    assert store.ledger()["attempts"][:4].tolist() == [3, 3, 4, 3]
    assert os.listdir(store.path / "claims") == []


def test_point_that_died_of_memory_is_out_of_memory(store: Store, compute: Any) -> None:
    die(store, memory=True)
    die(store, "0_2", times=2, memory=True)
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store), 0)
    assert sizes == [1, 1, 1]
    assert status_of(store) == [1, 1, Status.OUT_OF_MEMORY, 1]
    assert store.ledger()["attempts"][:4].tolist() == [2, 2, 3, 2]


def test_block_whose_model_did_not_return_is_done_point_by_point_at_once(
    store: Store, compute: Any
) -> None:
    die(store, hang=True)
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store), 0)
    assert sizes == [1, 1, 1, 1]


def test_point_that_did_not_return_alone_has_timed_out(store: Store, compute: Any) -> None:
    # Also when its driver had to end with it.
    die(store, hang=True, driver="")
    die(store, "0_2", hang=True, driver="")
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store, run=2), 0)
    assert sizes == [1, 1, 1]
    assert status_of(store) == [1, 1, Status.TIME_OUT, 1]
    limit = store.sweep.integrator.time_out + store.sweep.run.patience
    assert store.ledger()["elapsed_us"][2] == 1e6 * limit
    assert store.ledger()["attempts"][:4].tolist() == [2, 2, 2, 2]
    assert os.listdir(store.path / "claims") == []


def test_workers_that_died_with_their_driver_say_nothing_of_the_points(
    store: Store, compute: Any
) -> None:
    die(store, times=5)
    die(store, "0_2", times=5)
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store, run=2), 0)
    assert sizes == [4]
    assert store.ledger()["attempts"][:4].tolist() == [1, 1, 1, 1]
    assert os.listdir(store.path / "claims") == []


def test_drivers_that_died_of_their_own_work_count(store: Store, compute: Any) -> None:
    die(store, times=2, driver="")
    sizes = compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store, run=2), 0)
    assert sizes == [1, 1, 1, 1]


def test_failed_points_are_tried_again_as_often_as_asked(store: Store, compute: Any) -> None:
    compute(lambda sweep, points, _: failed_block(sweep, points, Status.TIME_OUT))
    do_block(message(store), 0)
    sizes = compute(lambda sweep, points, _: failed_block(sweep, points, Status.TIME_OUT))
    for _ in range(3):
        do_block(message(store, retry=RetryPolicy(attempts=3)), 0)
    assert sizes == [4, 4]
    assert store.ledger()["attempts"][:4].tolist() == [3, 3, 3, 3]


def test_retry_takes_only_failures_of_earlier_runs_and_its_own_limits(
    store: Store, compute: Any
) -> None:
    limits = []

    def run(sweep: Sweep, points: Points, _: Any) -> BlockResult:
        limits.append((sweep.integrator.time_out, sweep.integrator.max_steps))
        return failed_block(sweep, points, Status.STEP_BUDGET)

    compute(run)
    do_block(message(store), 0)
    retry = RetryPolicy(
        10, (Status.STEP_BUDGET,), earlier_only=True, time_out=7.0, max_steps=8
    ).of_run(2)
    for _ in range(2):
        do_block(message(store, run=2, retry=retry), 0)
    assert limits == [(600.0, 10_000_000), (7.0, 8)]


def test_results_do_not_depend_on_how_the_block_was_split(store: Store, compute: Any) -> None:
    die(store, times=2)
    compute(lambda sweep, points, _: done(sweep, points))
    do_block(message(store), 0)
    do_block(message(store), 1)
    features = store.features()[:8, 0, 0]
    assert np.array_equal(features, store.points.columns["seed"][:8])
