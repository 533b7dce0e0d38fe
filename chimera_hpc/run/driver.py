"""The driver of ``run`` and ``retry``: computes everything that a store lacks, despite failures."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import HOPELESS
from chimera_hpc.base.processes import process_identity
from chimera_hpc.base.status import Status
from chimera_hpc.run.progress import Reporter
from chimera_hpc.run.signals import StopRequest
from chimera_hpc.run.slurm.walltime import NEAR, time_to_leave
from chimera_hpc.run.watchdog import watchdog
from chimera_hpc.store.claims import live_claims
from chimera_hpc.store.ledger import RESULTS, unfinished, with_those_behind
from chimera_hpc.store.provenance import differences, gather
from chimera_hpc.store.runs import BlockWork

if TYPE_CHECKING:
    from chimera_hpc.run.choice import ExecutorChoice
    from chimera_hpc.run.messages import BlockError, BlockReceipt, RetryPolicy, RunMessage
    from chimera_hpc.store.store import Store

_CLUSTER_TRIES = 3
"""Times that a cluster may be lost before a block is done."""
_BLOCK_TRIES = 3
"""Errors of the operating system after which a block is left for a later run."""
_LONGEST_WAIT = 10.0
_FIRST_RUN = "CHIMERA_HPC_FIRST_RUN"
"""Environment variable of a process that continues for another one: the number of its run."""
_RUNS_COMPARED = 20
_RECORD_SECONDS = 30.0
"""What is known of the work is written this often: a run that is killed leaves it."""


class Refreshing(Protocol):
    """Something that follows a run, such as its report."""

    def refresh(self, note: Callable[[str], None]) -> None: ...


class Driver:
    """Computes what a store lacks, and records what prevents its completion."""

    def __init__(
        self,
        store: Store,
        executor: ExecutorChoice,
        stop: StopRequest,
        log: Path,
        retry: RetryPolicy,
        strict: bool = False,
    ) -> None:
        self.store, self.executor, self.stop = store, executor, stop
        self.retry, self.strict, self.log = retry, strict, log
        self.ended_by: str | None = None
        """Why the run cannot continue, on one line."""
        self.broken: dict[int, BlockError] = {}
        """Blocks that were left for a later run, and why."""
        self._errors: Counter[int] = Counter()
        self._machines: list[str] = []
        self._work_done = BlockWork(0, 0.0)
        self._recorded = 0.0
        self._late = False
        self._refused: str | None = None
        self.report: Refreshing | None = None
        """Rewritten from time to time during the run, if given."""
        self.meanwhile: Callable[[], object] | None = None
        """What to do in a thread while workers start, if given."""
        self.program: list[str] | None = None
        """The command line of this process, if it runs nothing else."""

    def work(self) -> None:
        """Compute what is left of the store until nothing is left or a stop is requested.

        Raises BadInput for errors that only another job or another model can correct.
        """
        try:
            workers = self.executor.n_workers
            reporter = Reporter(self.store.n_points, self.log, workers=workers)
        except OSError as error:
            raise _cannot_write(self.log, error) from None
        with reporter as self.reporter, self.stop.good_order():
            self._work()
        if self._refused is not None:
            raise BadInput(self._refused)

    def should_stop(self) -> bool:
        """Return whether a signal asked to stop, or the run cannot continue."""
        if self.ended_by is None and time_to_leave():
            self.ended_by = NEAR
        return self.stop() or self.ended_by is not None

    def pending(self) -> list[int]:
        """Return the blocks with something to do that were not left for a later run."""
        retry = self.retry
        blocks = self.store.pending(
            True, attempts=retry.attempts, statuses=retry.statuses, before=retry.before
        )
        index, count = self.executor.share or (0, 1)
        left = [b for b in blocks if b not in self.broken]
        if self.store.sweep.decide is not None:
            # All shares are needed before the next round: own blocks first, then any.
            return sorted(left, key=lambda b: (b - index) % count)
        return [b for b in left if b % count == index]

    def next_round(self) -> bool:
        """Add the points of the next round of a sweep with [decide]; return whether there are any.

        Others may have added them already.
        """
        if self.store.sweep.decide is None or self.broken or self.should_stop():
            return False
        from chimera_hpc.run.rounds import next_round

        began, before = time.perf_counter(), self.store.n_points
        store = next_round(self.store)
        if store is None:
            return False
        self.store = store
        seconds = time.perf_counter() - began
        self.reporter.grow(store.n_points)
        self.reporter.say(
            f"round {len(store.sweeps)}: {store.n_points - before} points more, "
            f"{store.n_points} in all ({seconds:.1f} s)"
        )
        return True

    def _check_judge(self) -> None:
        """Raise BadInput, before anything is computed, when the atlas that judges is missing."""
        if self.store.sweep.decide is not None:
            from chimera_hpc.run.judge import judge_warnings, other_judge

            other_judge(self.store)
            for line in judge_warnings(self.store):
                self.reporter.say(f"warning: {line}")

    def _count(self) -> None:
        """Set the counts of the reporter from the ledger, for points of all runs."""
        retry, ledger = self.retry, self.store.ledger()
        to_do = unfinished(ledger, retry.attempts, retry.statuses, retry.before)
        to_do = with_those_behind(to_do, ledger["status"], self.store.block_size)
        failed = ~to_do & (ledger["status"] > max(RESULTS))
        self.reporter.count(int((~to_do).sum()), int(failed.sum()))

    def _work(self) -> None:
        store, say = self.store, self.reporter.say
        try:
            for line in store.repair():
                say(line)
            self._check_judge()
            blocks = self.pending()
            if not blocks and self.next_round():
                blocks = self.pending()
            self._count()
            if not blocks:
                say("nothing to compute")
                return
            message = self._start(len(blocks))
        except OSError as error:
            raise _cannot_write(store.path, error) from None
        try:
            if self.executor.kind == "serial":
                self._serial(message)
            else:
                self._on_cluster(message)
        except OSError as error:
            self.ended_by = f"{error.strerror or error}" + f" ({error.filename})"
        finally:
            _remove(message.stop_file)
            self._record(message)

    def _start(self, n_blocks: int) -> RunMessage:
        """Record the run, and compile what it needs."""
        from chimera_hpc.run.compiled import compile_once
        from chimera_hpc.run.messages import RunMessage

        store, say = self.store, self.reporter.say
        info = gather(store.sweep)
        for line in changes(store, info, self.strict):
            say(line)
        run = store.start_run({**info, "cluster": self.executor.kind})
        kind = self.executor.kind
        say(f"run {run}: {n_blocks} of {store.n_blocks} blocks to do, {kind}, in {store.path}")
        if self.executor.compiles_here:
            began = time.perf_counter()
            compile_once(store.sweep, store.points, load=kind == "serial", say=say)
            self.reporter.note(f"kernels ready after {time.perf_counter() - began:.1f} s")
        # A process that took the place of another one does not retry what that one has tried.
        self.retry = self.retry.of_run(int(os.environ.pop(_FIRST_RUN, run)))
        return RunMessage(store.path, run, self.retry, process_identity())

    def _serial(self, message: RunMessage) -> None:
        from chimera_hpc.run.executors import run_serial

        before = watchdog.on_hang, watchdog.on_stop
        watchdog.on_hang = lambda text: self._start_again(text, message)
        watchdog.on_stop = lambda: self._give_back(message)
        try:
            for blocks in self._rounds():
                run_serial(
                    message, self._in_time(blocks), self._receiver(message), self.should_stop
                )
        finally:
            watchdog.on_hang, watchdog.on_stop = before

    def _give_back(self, message: RunMessage) -> None:
        """Release the current blocks: this process is stopped while its model computes."""
        from chimera_hpc.run.work import hand_back_all

        hand_back_all()
        self._record(message)
        self.reporter.close()

    def _start_again(self, text: str, message: RunMessage) -> None:
        """Replace this process, whose model does not return, by the same command."""
        from chimera_hpc.run.work import blame_model

        blame_model()
        self._record(message)
        if self.program is None:
            self.reporter.say(f"{text}; the same command in another process goes on without it")
            return
        self.reporter.say(f"{text}: this command starts again and goes on")
        self.reporter.close()
        sys.stdout.flush()
        first = min(self.retry.before, message.run)
        os.execve(sys.executable, self.program, {**os.environ, _FIRST_RUN: str(first)})

    def _on_cluster(self, message: RunMessage) -> None:
        from chimera_hpc.run.executors import ClusterLost

        losses, done = 0, self.reporter.done
        while losses < _CLUSTER_TRIES:
            try:
                self._on_one_cluster(message)
                return
            except ClusterLost as error:
                losses = 1 if self.reporter.done > done else losses + 1
                reason = str(error)
            except BadInput as error:
                if not losses:
                    raise
                losses, reason = losses + 1, str(error)
            done = self.reporter.done
            self.reporter.say(f"the cluster is lost ({reason}), {losses} of {_CLUSTER_TRIES} times")
            if self.stop():
                return
        self.ended_by = "the cluster was lost again and again"

    def _on_one_cluster(self, message: RunMessage) -> None:
        from chimera_hpc.run.executors import run_dask

        patience, n_blocks = self.store.sweep.run.patience, len(self.pending())
        with self.executor.cluster(
            self.store.path, n_blocks, self.reporter.say, patience, self.meanwhile
        ) as (client, may_come):
            for blocks in self._rounds():
                run_dask(
                    client,
                    message,
                    self._in_time(blocks),
                    self._receiver(message),
                    self.should_stop,
                    patience,
                    may_come,
                )

    def _receiver(self, message: RunMessage) -> Callable[[BlockReceipt], None]:
        return lambda receipt: self._note(message, receipt)

    def _in_time(self, blocks: list[int]) -> Iterator[int]:
        """Yield blocks as long as none has turned out to be too long for the job's time."""
        for block in blocks:
            if self._late:
                return
            yield block

    def _rounds(self) -> Iterator[list[int]]:
        """Yield the free blocks repeatedly until nothing is left or a stop is requested.

        It waits for blocks that other processes own, because an owner may die.
        """
        wait = 0.25
        while not self.should_stop():
            blocks = self.pending()
            if not blocks:
                if self.next_round():
                    continue
                return
            self._count()
            others = live_claims(self.store.path)
            free = [block for block in blocks if block not in others]
            before = self.reporter.done
            if free:
                yield free
            if self._late:
                self.ended_by = self.ended_by or NEAR
                return
            if self.reporter.done > before:
                wait = 0.25
            elif blocks:
                self._sleep(wait)
                wait = min(2 * wait, _LONGEST_WAIT)

    def _sleep(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until and not self.should_stop():
            time.sleep(0.05)

    def _note(self, message: RunMessage, receipt: BlockReceipt) -> None:
        """Record a receipt."""
        self._work_done += BlockWork(receipt.n_done + receipt.n_failed, receipt.seconds)
        is_new = bool(receipt.machine) and receipt.machine not in self._machines
        if is_new:
            self._machines.append(receipt.machine)
        if is_new or time.monotonic() - self._recorded > _RECORD_SECONDS:
            self._record(message)
        if receipt.error is not None:
            self._note_error(receipt.block, receipt.error)
        # A worker that is a job of its own is followed by another one.
        self._late |= receipt.late and self.executor.kind != "slurm"
        if not receipt.taken:
            self.reporter.note(
                f"block {receipt.block}: {receipt.n_done} done, {receipt.n_failed} failed, "
                f"{receipt.seconds:.2f} s"
            )
            self.reporter.add(receipt.n_done, receipt.n_failed, receipt.seconds)
        if self.report is not None:
            self.report.refresh(self.reporter.note)

    def _record(self, message: RunMessage) -> None:
        """Write next to the run's record where its points were computed, how long, until when."""
        from chimera_hpc.store.runs import record_work

        self._recorded = time.monotonic()
        now = datetime.now(UTC).isoformat(timespec="seconds")
        info = {"machines": self._machines, "until": now, **self._work_done.record()}
        try:
            record_work(message.store, message.run, info)
        except OSError:
            # A disk that is full will be heard of from the blocks.
            return

    def _note_error(self, block: int, error: BlockError) -> None:
        self.reporter.note(f"block {block}: {error.trace}")
        self._errors[block] += 1
        if error.bad_input:
            self._refused = self._refused or error.text
        if error.errno in HOPELESS or error.bad_input:
            self.ended_by = self.ended_by or error.text
        elif error.errno is None or self._errors[block] >= _BLOCK_TRIES:
            self.broken[block] = error
            self.reporter.say(f"block {block} is left for a later run: {error.text}")


def changes(store: Store, info: dict[str, Any], strict: bool) -> list[str]:
    """Return a line for each thing that may change numbers since the results in a store were made.

    Raises BadInput when there is any, and `strict` forbids it.
    """
    from chimera_hpc.store.runs import read_run

    lines: dict[str, None] = {}
    for run in runs_of_results(store)[-_RUNS_COMPARED:]:
        try:
            before = read_run(store.path, run)
        except BadInput as error:
            lines[str(error)] = None
            continue
        lines |= dict.fromkeys(f"run {run} had other {line}" for line in differences(before, info))
    if lines and strict:
        raise BadInput(f"{store.path}: --strict: " + "; ".join(lines))
    return [f"warning: {line}; its points stay, marked by their run" for line in lines]


def runs_of_results(store: Store) -> list[int]:
    """Return the numbers of the runs that left results in a store, rising."""
    ledger = store.ledger()
    return sorted({int(run) for run in set(ledger["run"][ledger["status"] != Status.NEVER])})


def _cannot_write(path: Path, error: OSError) -> BadInput:
    where = error.filename or path
    return BadInput(f"{where}: can't be written: {error.strerror or error}")


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return
