"""Working through the blocks of a store: one block, one after the other, or over a Dask cluster.

The serial executor is the specification: every other one calls the same `do_block` on the same
blocks and leaves the same bytes. What is done is known from the store alone; an executor that is
killed loses the blocks in flight and nothing else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.claims import Claim, ClaimLost, claim_block
from chimera_hpc.status import Status
from chimera_hpc.store import Store
from chimera_hpc.task import BlockResult, failed_block, run_block

if TYPE_CHECKING:
    from distributed import Client, Future

# Blocks submitted to the scheduler at a time, for each worker: enough that none waits, few enough
# that a lost worker takes no crowd of innocent tasks with it.
WINDOW = 3
# Deaths of its workers after which a block is done point by point, to find the culprit.
LOSSES_BEFORE_SPLIT = 2
_STOP_LOOK_SECONDS = 0.3


@dataclass(frozen=True)
class BlockReceipt:
    """What became of one block in this run: small, so that a scheduler can carry thousands."""

    block: int
    n_done: int = 0
    n_failed: int = 0
    seconds: float = 0.0
    taken: bool = False
    """Somebody else was at it."""
    stopped: bool = False
    """The run was told to stop before the block was whole."""


@dataclass(frozen=True)
class Again:
    """Which failed points are run once more."""

    attempts: int = 0
    """Points tried fewer times than this."""
    statuses: tuple[Status, ...] = (Status.TIME_OUT, Status.OUT_OF_MEMORY)
    """Points that failed in one of these ways. Numerical failures had their further tries, under
    tighter tolerances, inside the task; a point that killed its workers is left alone."""


OnReceipt = Callable[[BlockReceipt], None]


def stop_file(store: Path, run: int) -> Path:
    """File whose presence tells the workers of a run, wherever they are, to stop in good order."""
    return store / "runs" / f"{run}.stop"


@dataclass
class StopSignal:
    """Whether to stop: asked by the integrator about ten times a second, and kept cheap."""

    file: Path
    local: Callable[[], bool] | None = None
    _looked: float = field(default=0.0)
    _found: bool = field(default=False)

    def __call__(self) -> bool:
        """Return whether the run is to stop."""
        if self.local is not None and self.local():
            return True
        now = time.monotonic()
        if now - self._looked > _STOP_LOOK_SECONDS:
            self._looked = now
            self._found = self.file.exists()
        return self._found


@lru_cache(maxsize=4)
def _opened(path: Path, stamp: int) -> Store:
    return Store.open(path)


def open_cached(path: Path) -> Store:
    """Open a store, once a process as long as its metadata don't change."""
    return _opened(path, (path / "zarr.json").stat().st_mtime_ns)


def do_block(
    path: Path,
    block: int,
    run: int,
    again: Again = Again(),
    local_stop: Callable[[], bool] | None = None,
) -> BlockReceipt:
    """Claim a block, compute what is to do in it, write it: the one unit of work of all executors.

    Parameters
    ----------
    path : Path
        The store.
    block, run : int
        Number of the block; number of the run, for the ledger.
    again : Again
        Which failed points are run once more, beside those that never ran.
    local_stop : callable, optional
        A second reason to stop, beside the run's stop file.
    """
    began = time.perf_counter()
    store = open_cached(path)
    claim = claim_block(path, block, run)
    if claim is None:
        return BlockReceipt(block, taken=True)
    stop = StopSignal(stop_file(path, run), local_stop)
    try:
        done, failed, whole = _work(store, claim, block, run, again, stop)
    except ClaimLost:
        return BlockReceipt(block, taken=True)
    except BaseException:
        claim.hand_back()
        raise
    if whole:
        claim.release()
    else:
        claim.hand_back()
    return BlockReceipt(
        block, done, failed, time.perf_counter() - began, stopped=not whole
    )


def _work(
    store: Store, claim: Claim, block: int, run: int, again: Again, stop: StopSignal
) -> tuple[int, int, bool]:
    rows = store.points_to_do(block, again.attempts, again.statuses)
    losses = sum(not attempt.handed_back for attempt in claim.lost)
    groups = rows[:, None] if losses >= LOSSES_BEFORE_SPLIT else [rows]
    done = failed = 0
    for group in groups:
        if not len(group):
            continue
        alone = len(group) == 1 and losses >= LOSSES_BEFORE_SPLIT
        result = (
            _compute_alone(store, claim, block, int(group[0]), run, stop)
            if alone
            else _compute(store, claim, block, group, stop)
        )
        receipt = store.write_block(block, result, run, 1 if alone else claim.attempts, claim, group)
        done, failed = done + receipt.n_done, failed + receipt.n_failed
        if (result.status == Status.NEVER).any():
            return done, failed, False
    return done, failed, True


def _compute(
    store: Store, claim: Claim, block: int, rows: NDArray[np.int64], stop: StopSignal
) -> BlockResult:
    start, _ = store.block(block)

    def should_stop() -> bool:
        return not claim.refresh() or stop()

    points = store.points[start + rows]
    try:
        return run_block(store.sweep, points, should_stop=should_stop)
    except MemoryError:
        return failed_block(store.sweep, points, Status.OUT_OF_MEMORY)


def _compute_alone(
    store: Store, claim: Claim, block: int, row: int, run: int, stop: StopSignal
) -> BlockResult:
    # The point has a claim of its own, so that it is known whose death a lost worker was.
    rows = np.array([row])
    own = claim_block(store.path, f"{block}_{row}", run)
    if own is None:
        raise ClaimLost(f"point {row} of block {block} is in other hands")
    deaths = sum(not attempt.handed_back for attempt in own.lost)
    if deaths >= store.sweep.run.attempts:
        start, _ = store.block(block)
        own.release()
        return failed_block(store.sweep, store.points[start + rows], Status.WORKER_LOST)
    try:
        result = _compute(store, claim, block, rows, stop)
    except BaseException:
        own.hand_back()
        raise
    own.release()
    return result


def run_serial(
    store: Store,
    blocks: Sequence[int],
    run: int,
    on_receipt: OnReceipt,
    should_stop: Callable[[], bool],
    again: Again = Again(),
) -> None:
    """Do the blocks one after the other in this process."""
    for block in blocks:
        if should_stop():
            return
        on_receipt(do_block(store.path, block, run, again, should_stop))


def run_dask(
    store: Store,
    client: Client,
    blocks: Sequence[int],
    run: int,
    on_receipt: OnReceipt,
    should_stop: Callable[[], bool],
    again: Again = Again(),
) -> None:
    """Do the blocks on a Dask cluster, a bounded window of them at a time.

    Workers write their blocks themselves and send back receipts. A task whose worker died is
    submitted again: the claims in the store count the losses, so the culprit is found.
    """
    waiting = iter(blocks)
    window: dict[Future[BlockReceipt], int] = {}
    submitted = 0

    def submit(block: int) -> None:
        nonlocal submitted
        submitted += 1
        future = client.submit(
            do_block,
            *(store.path, block, run, again),
            key=f"block-{block}-{run}-{submitted}",
            pure=False,
            retries=0,
        )
        window[future] = block

    def top_up() -> None:
        room = WINDOW * max(1, len(client.scheduler_info(n_workers=-1)["workers"])) - len(window)
        for block in _take(waiting, room):
            submit(block)

    top_up()
    stopping = False
    while window:
        if should_stop() and not stopping:
            stopping = True
            stop_file(store.path, run).touch()
        for future in _finished(window):
            block = window.pop(future)
            error = None if future.cancelled() else future.exception()
            if future.cancelled() or (error is not None and stopping):
                continue
            if error is None:
                on_receipt(future.result())
            elif _is_loss(error):
                submit(block)
            else:
                raise error
        if not stopping:
            top_up()


def _take(waiting: Iterator[int], count: int) -> Iterator[int]:
    for _ in range(count):
        block = next(waiting, None)
        if block is None:
            return
        yield block


def _finished(window: dict[Future[BlockReceipt], int]) -> list[Future[BlockReceipt]]:
    from distributed import wait

    try:
        wait(list(window), timeout=0.5, return_when="FIRST_COMPLETED")
    except TimeoutError:
        return []
    return [future for future in window if future.done()]


def _is_loss(error: BaseException) -> bool:
    from distributed.scheduler import KilledWorker

    return isinstance(error, KilledWorker)

