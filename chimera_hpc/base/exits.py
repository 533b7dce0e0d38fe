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
    """What the command prints could not be written, as on a full disk."""
    MORE_TO_DO = 75
    """Points are pending: stopped in good order (SIGTERM, SIGUSR1, end of a job), or more points
    were added meanwhile. The same command continues."""
    INTERRUPTED = 130
    """Stopped by Ctrl-C; the same command continues."""

    @classmethod
    def of_points(cls, pending: int, failed: int) -> Exit:
        """Return the status of a sweep with so many points that did not run, or failed."""
        if pending:
            return cls.MORE_TO_DO
        return cls.FAILURES if failed else cls.COMPLETE
