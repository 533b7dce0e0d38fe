"""Exit statuses of the command line."""

from __future__ import annotations

from enum import IntEnum


class Exit(IntEnum):
    """Meaning of a command's exit status."""

    COMPLETE = 0
    """Every point has a result."""
    FAILURES = 1
    """Some points failed; they are listed."""
    BAD_INPUT = 2
    """Wrong input. One line says what, where and what is allowed."""
    NO_OUTPUT = 74
    """The output of the command could not be written, for example because the disk is full."""
    MORE_TO_DO = 75
    """Points are pending: the command was stopped cleanly (SIGTERM, SIGUSR1, end of a job), or
    points were added during the run. The same command continues."""
    INTERRUPTED = 130
    """Stopped by Ctrl-C; the same command continues."""

    @classmethod
    def of_points(cls, pending: int, failed: int) -> Exit:
        """Return the exit status of a sweep with these numbers of pending and failed points."""
        if pending:
            return cls.MORE_TO_DO
        return cls.FAILURES if failed else cls.COMPLETE
