"""What a run tells its workers, and what they answer for each block.

This is separate from `work`, so that a driver whose workers integrate need not load the integrator.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.store.ledger import NO_LIMIT


@dataclass(frozen=True)
class RetryPolicy:
    """Which failed points are run once more, in addition to the points that never ran."""

    attempts: int = 0
    """Those that were tried fewer times than this."""
    statuses: tuple[Status, ...] = (Status.TIME_OUT, Status.OUT_OF_MEMORY)
    """Those that failed in one of these ways. Numerical failures had their further tries, under
    tighter tolerances, inside the task; a point that killed its workers is left alone."""
    earlier_only: bool = False
    """Those that failed in an earlier run than the one that asks."""
    before: int = NO_LIMIT
    """Those that failed in a run below this number."""
    time_out: float | None = None
    """Seconds of wall time per point in place of `integrator.time_out`."""
    max_steps: int | None = None
    """Steps per point in place of `integrator.max_steps`."""

    def of_run(self, run: int) -> RetryPolicy:
        """Return the same for a run that has got its number."""
        return replace(self, before=run) if self.earlier_only else self

    def applied(self, sweep: Sweep) -> Sweep:
        """Return the sweep with these limits: they decide how far a point gets, not its numbers."""
        limits = {"time_out": self.time_out, "max_steps": self.max_steps}
        given = {name: limit for name, limit in limits.items() if limit is not None}
        if not given:
            return sweep
        return sweep.model_copy(update={"integrator": sweep.integrator.model_copy(update=given)})


@dataclass(frozen=True)
class RunMessage:
    """What a run tells its workers."""

    store: Path
    run: int
    retry: RetryPolicy = RetryPolicy()
    driver: str = ""
    """Identity of the process that sends the message, see `processes.process_identity`."""

    @property
    def stop_file(self) -> Path:
        """File whose presence tells the workers of the run, wherever they are, to stop."""
        return self.store / "runs" / f"{self.run}.stop"


@dataclass(frozen=True)
class BlockError:
    """Why a block could not be computed, although no point of it is known to be the cause."""

    text: str
    """One line for people."""
    trace: str
    """The traceback, for the log."""
    errno: int | None = None
    """Of an error of the operating system, such as a full disk."""
    bad_input: bool = False
    """Only another job can put it right: the run ends."""


@dataclass(frozen=True)
class BlockReceipt:
    """What became of one block in this run: small, so that a scheduler can carry thousands."""

    block: int
    n_done: int = 0
    n_failed: int = 0
    seconds: float = 0.0
    taken: bool = False
    """Another process owns the block."""
    stopped: bool = False
    """The run was told to stop before the block was complete."""
    late: bool = False
    """It was not started or not finished, because the time left of the batch job is too short."""
    error: BlockError | None = None
    machine: str = ""
    """Where it was computed."""


def tell_to_stop(message: RunMessage) -> None:
    """Tell all workers of a run to stop cleanly; on a full disk they notice by themselves."""
    with suppress(OSError):
        message.stop_file.touch()
