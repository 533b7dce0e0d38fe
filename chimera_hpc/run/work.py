"""One block: claim, compute, write. All executors share this unit of work.

The receipt of a block reports every error; no exception passes through a scheduler.
"""

from __future__ import annotations

import os
import socket
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.files import HOPELESS
from chimera_hpc.base.status import Status
from chimera_hpc.job import Points
from chimera_hpc.run.block import DoesNotFit, run_block
from chimera_hpc.run.chain import Chain
from chimera_hpc.run.messages import BlockError, BlockReceipt, RunMessage, tell_to_stop
from chimera_hpc.run.slurm import walltime
from chimera_hpc.run.watchdog import limit_of
from chimera_hpc.store.block_result import BlockResult, failed_block
from chimera_hpc.store.claims import Claim, ClaimLost, LostAttempt, claim_block, forget_points
from chimera_hpc.store.ledger import METADATA
from chimera_hpc.store.provenance import cpu_model
from chimera_hpc.store.store import Store

LOSSES_BEFORE_SPLIT = 2
"""Deaths of its workers after which a block is done point by point, to find the culprit."""
_STOP_LOOK_SECONDS = 0.3

Rows = NDArray[np.int64]


@dataclass
class StopSignal:
    """Whether to stop: asked by the integrator about ten times a second, and kept cheap."""

    file: Path
    local: Callable[[], bool] | None = None
    _looked: float = field(default=0.0)
    _found: bool = field(default=False)

    def __call__(self) -> bool:
        """Return whether the run is to stop."""
        if walltime.time_to_leave() or (self.local is not None and self.local()):
            return True
        now = time.monotonic()
        if now - self._looked > _STOP_LOOK_SECONDS:
            self._looked = now
            self._found = self.file.exists()
        return self._found


def do_block(
    message: RunMessage, block: int, local_stop: Callable[[], bool] | None = None
) -> BlockReceipt:
    """Claim a block, compute its pending points, write it.

    local_stop: a second reason to stop, next to the run's stop file.
    """
    stop = StopSignal(message.stop_file, local_stop)
    if stop():
        # It waited in a worker's queue: nothing is begun that would only be broken off.
        return BlockReceipt(block, stopped=True)
    try:
        return _Block(message, block, stop).do()
    except ClaimLost:
        return BlockReceipt(block, taken=True)
    except OSError as failure:
        where = f" ({failure.filename})" if failure.filename else ""
        error = _block_error(f"{failure.strerror or failure}{where}", failure.errno)
        if failure.errno in HOPELESS:
            # Before a worker computes the next block in its queue for nothing.
            tell_to_stop(message)
    except DoesNotFit as failure:
        error = BlockError(str(failure), traceback.format_exc(), bad_input=True)
        tell_to_stop(message)
    except Exception as failure:
        error = _block_error(_in_a_line(failure))
    return BlockReceipt(block, error=error, machine=_machine())


def hand_back_all() -> None:
    """Release all claims at once: this process is being ended, but its work is not the cause."""
    for claim in _in_hand:
        with suppress(OSError):
            claim.hand_back()


def blame_memory() -> None:
    """Record in the claims of this process that it is being ended for its use of memory."""
    for claim in _in_hand:
        claim.blame_memory()


def blame_model() -> None:
    """Record in the claims of this process that it is being ended because its model hangs."""
    for claim in _in_hand:
        claim.blame_model()


def is_busy() -> bool:
    """Return whether this process holds any claim."""
    return bool(_in_hand)


_in_hand: list[Claim] = []
"""The claims that this process holds now."""


class _Block:
    """A block that is being computed: its pending points, and its results so far."""

    def __init__(self, message: RunMessage, block: int, stop: StopSignal) -> None:
        self.message, self.block, self.stop = message, block, stop
        self.store = open_cached(message.store)
        self.sweep = message.retry.applied(self.store.sweep)
        self.n_done = self.n_failed = 0
        self.error: BlockError | None = None
        self.chain: Chain | None = None

    def do(self) -> BlockReceipt:
        began = time.perf_counter()
        hours = walltime.this_job()
        if hours is not None and not hours.fits(self.store, self._rows_to_do()):
            walltime.leave_if_worker()
            return BlockReceipt(self.block, stopped=True, late=True)
        with self._claimed(self.block) as claim:
            whole = self._work(claim)
            if whole and claim.lost:
                forget_points(self.store.path, self.block)
            _end(claim, whole)
        return BlockReceipt(
            self.block,
            self.n_done,
            self.n_failed,
            time.perf_counter() - began,
            stopped=not whole,
            late=not whole and walltime.time_to_leave(),
            error=self.error,
            machine=_machine(),
        )

    def _rows_to_do(self) -> Rows:
        """Return which points of the store are pending, as seen without a claim."""
        retry = self.message.retry
        rows = self.store.points_to_do(self.block, retry.attempts, retry.statuses, retry.before)
        if self.store.n_state:
            rows = rows[:1]  # a chain goes on where it was broken off
        return self.store.block(self.block)[0] + rows

    @contextmanager
    def _claimed(self, name: int | str) -> Iterator[Claim]:
        """Hold a claim; release it to others if the work is interrupted."""
        note = {"driver": self.message.driver}
        patience = self.sweep.run.patience
        claim = claim_block(self.store.path, name, self.message.run, expiry=patience, note=note)
        if claim is None:
            raise ClaimLost(f"{name} is in other hands")
        _in_hand.append(claim)
        try:
            yield claim
        except BaseException:
            with suppress(OSError):
                claim.hand_back()
            raise
        finally:
            _in_hand.remove(claim)

    def _work(self, claim: Claim) -> bool:
        """Compute the pending points; return whether all of them were reached."""
        retry = self.message.retry
        rows = self.store.points_to_do(self.block, retry.attempts, retry.statuses, retry.before)
        together, alone = _tries_together(self._deaths(claim))
        if self.store.n_state:
            return self._work_along(claim, rows, together, alone)
        groups = _pieces(rows, 1 if alone else max(1, len(rows)))
        while groups:
            group = groups.pop(0)
            if alone:
                result, tries = self._compute_alone(claim, group, together)
            else:
                result, tries = self._compute(group, claim), together + 1
            if result is None:
                groups = _pieces(group, -(-len(group) // 2)) + groups
                continue
            self._write(claim, result, tries, group)
            if self.stop() and (result.status == Status.NEVER).any():
                return False
        return True

    def _work_along(self, claim: Claim, rows: Rows, together: int, alone: bool) -> bool:
        """Compute points of a chain one by one; return whether all of them were reached."""

        def write(result: BlockResult, tries: int, rows: Rows) -> None:
            self._write(claim, result, tries, rows)

        self.chain = chain = Chain(self.store, self.block, write)
        if chain.is_damaged:
            rows = np.arange(len(chain.states))
        reached = True
        for row in rows.tolist():
            point, tries = np.array([row]), together + 1
            if chain.is_cut(row):
                result: BlockResult | None = self._none(self._points(point), Status.NOT_STARTED)
            elif alone:
                result, tries = self._compute_alone(claim, point, together)
            else:
                result = self._compute(point, claim)
            assert result is not None
            chain.take(row, result, tries)
            if result.status[0] == Status.NEVER:
                reached = not self.stop()
                break
        chain.flush()
        return reached

    def _none(self, points: Points, status: Status) -> BlockResult:
        return failed_block(self.sweep, points, status, self.store.n_state)

    def _write(self, claim: Claim, result: BlockResult, tries: int, rows: Rows) -> None:
        receipt = self.store.write_block(self.block, result, self.message.run, tries, claim, rows)
        self.n_done += receipt.n_done
        self.n_failed += receipt.n_failed

    def _compute(self, rows: Rows, *claims: Claim) -> BlockResult | None:
        """Compute points; None when they are to be tried again, fewer at a time."""

        def should_stop() -> bool:
            return not all([claim.refresh() for claim in claims]) or self.stop()

        points = self._points(rows)
        start: dict[str, Any] = {}
        if self.chain is not None:
            start = {"starts": self.chain.starts(int(rows[0]))}
        try:
            return run_block(self.sweep, points, should_stop=should_stop, **start)
        except MemoryError:
            if len(rows) > 1:
                return None
            return self._none(points, Status.OUT_OF_MEMORY)
        except (OSError, DoesNotFit):
            raise
        except Exception as error:
            # An error in the code of a model: the other points of the block must not suffer.
            if len(rows) > 1:
                return None
            where = " ".join(f"{name}={points.row(0)[name]}" for name in points.axes)
            self.error = self.error or _block_error(f"point {where}: {_in_a_line(error)}")
            return self._none(points, Status.NEVER)

    def _compute_alone(
        self, claim: Claim, rows: Rows, before: int
    ) -> tuple[BlockResult | None, int]:
        """Compute one point under its own claim, to which a lost worker is then attributed."""
        with self._claimed(f"{self.block}_{rows[0]}") as own:
            deaths = self._deaths(own)
            tries = before + len(deaths)
            hangs = bool(deaths) and deaths[-1].no_return
            result: BlockResult | None
            if hangs or len(deaths) >= self.sweep.run.attempts:
                result = self._failed(self._points(rows), deaths[-1])
            else:
                result = self._compute(rows, claim, own)
                tries += 1
            _end(own, result is None or bool((result.status != Status.NEVER).all()))
        return result, tries

    def _failed(self, points: Points, death: LostAttempt) -> BlockResult:
        """Return the result of a point that killed its workers."""
        if death.no_return:
            result = self._none(points, Status.TIME_OUT)
            result.elapsed_us[:] = int(1e6 * limit_of(self.sweep))
            return result
        memory = death.out_of_memory
        status = Status.OUT_OF_MEMORY if memory else Status.WORKER_LOST
        return self._none(points, status)

    def _points(self, rows: Rows) -> Points:
        return self.store.block_points(self.block)[rows]

    def _deaths(self, claim: Claim) -> list[LostAttempt]:
        """Return the earlier attempts that may have died of the work itself.

        A worker that ended with or after its driver is no evidence against the points.
        """
        return [
            lost
            for lost in claim.lost
            if lost.out_of_memory
            or lost.no_return
            or (not lost.handed_back and self._died_by_itself(lost))
        ]

    def _died_by_itself(self, lost: LostAttempt) -> bool:
        process, note = lost.info.get("process"), lost.info.get("note")
        was_driver = isinstance(note, dict) and note.get("driver") == process
        return was_driver or lost.info.get("run") == self.message.run


def _tries_together(deaths: Sequence[LostAttempt]) -> tuple[int, bool]:
    """Return how many attempts were made on the whole block, and whether no more of them are."""
    for count, death in enumerate(deaths, start=1):
        if count == LOSSES_BEFORE_SPLIT or death.out_of_memory or death.no_return:
            return count, True
    return len(deaths), False


def _end(claim: Claim, whole: bool) -> None:
    if whole:
        claim.release()
    else:
        claim.hand_back()


def open_cached(path: Path) -> Store:
    """Open a store, once a process as long as its metadata don't change."""
    try:
        stamp = (path / METADATA).stat().st_mtime_ns
    except FileNotFoundError:
        stamp = 0
    return _opened(path, stamp)


@lru_cache(maxsize=4)
def _opened(path: Path, stamp: int) -> Store:
    return Store.open(path)


def _pieces(rows: Rows, size: int) -> list[Rows]:
    return [rows[i : i + size] for i in range(0, len(rows), size)]


def _block_error(text: str, errno: int | None = None) -> BlockError:
    return BlockError(text, traceback.format_exc(), errno)


def _in_a_line(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


@cache
def _machine() -> str:
    job = os.environ.get("SLURM_JOB_ID")
    return f"{socket.gethostname()}: {cpu_model()}" + (f", SLURM job {job}" if job else "")
