"""What every Dask worker process does before its first block (a Dask plugin)."""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from distributed import WorkerPlugin

from chimera_hpc.run.fork_server import BLOCKED
from chimera_hpc.run.slurm.walltime import WORKER, leaving, time_to_leave
from chimera_hpc.run.watchdog import say, watchdog

if TYPE_CHECKING:
    from distributed import Worker

_MEMORY = Path("/proc/self/statm")
_LEAVE_SECONDS = 1.5
"""Time for a block to stop cleanly when a batch system ends the worker."""
_NEARLY = 0.9
"""Share of the memory limit from which an end is put down to the use of memory; Dask ends a
worker at 0.95 of it."""


class SignalPlugin(WorkerPlugin):
    """How a worker process takes signals."""

    name = "chimera_hpc"

    def setup(self, worker: Worker) -> None:
        """Leave Ctrl-C to the driver, and record an end by the use of memory in the claims.

        A terminal sends SIGINT to all processes of a run at once; the driver stops the workers in
        good order. A nanny ends a worker that uses too much memory with SIGTERM: the next owner of
        its block must know.
        """
        limit = getattr(worker.memory_manager, "memory_limit", None)

        def end(number: int, frame: FrameType | None) -> None:
            # Before the first block that module is not there, or not whole.
            blame = getattr(sys.modules.get("chimera_hpc.run.work"), "blame_memory", None)
            if limit and blame is not None and resident_bytes() > _NEARLY * limit:
                blame()
            elif "SLURM_JOB_ID" in os.environ:
                # A cancelled, preempted or requeued job, or its time limit.
                _drop_work()
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)

        watchdog.on_hang = _end_at_once
        _on(signal.SIGINT, signal.SIG_IGN)
        if WORKER in os.environ:
            _leave_in_time(worker)
        _on(signal.SIGTERM, end)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, BLOCKED)

    def teardown(self, worker: Worker) -> None:
        """Skip garbage collection at the end of the process, which takes time."""
        gc.freeze()


def _end_at_once(text: str) -> None:
    """End this process, whose model does not return; its nanny starts another one."""
    from chimera_hpc.run.work import blame_model

    blame_model()
    say(text)
    os.kill(os.getpid(), signal.SIGKILL)


def _drop_work() -> None:
    """Wait a short time for the current block to be stopped cleanly; then release it."""
    from chimera_hpc.run.work import hand_back_all, is_busy

    leaving.set()
    until = time.monotonic() + _LEAVE_SECONDS
    while is_busy() and time.monotonic() < until:
        time.sleep(0.02)
    hand_back_all()


def _leave_in_time(worker: Worker) -> None:
    """Close the worker when its job's time is over, or when it was told to leave."""
    from tornado.ioloop import PeriodicCallback

    async def look() -> None:
        if time_to_leave():
            leaving.set()
            watch.stop()
            await worker.close_gracefully()

    watch = PeriodicCallback(look, 500)
    worker.loop.add_callback(watch.start)


def resident_bytes() -> int:
    """Return the memory that this process occupies, 0 where the system does not tell."""
    try:
        pages = int(_MEMORY.read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def _on(number: int, handler: Any) -> None:
    try:
        signal.signal(number, handler)
    except ValueError:
        # Not in the main thread: a worker inside another program, which keeps its signals.
        return
