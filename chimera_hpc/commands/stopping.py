"""Stopping in good order: what the signals of people and of batch systems ask for."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from chimera_hpc.commands.exits import Exit

_ORDERLY = (signal.SIGTERM, signal.SIGUSR1)


class StopRequest:
    """Whether a signal asked to stop, and which exit status it leads to."""

    def __init__(self) -> None:
        self.signal: int | None = None

    def __call__(self) -> bool:
        """Return whether to stop."""
        return self.signal is not None

    @property
    def exit_status(self) -> Exit:
        """Status to leave with when the work was not finished."""
        return Exit.INTERRUPTED if self.signal == signal.SIGINT else Exit.MORE_TO_DO


@contextmanager
def stop_request() -> Iterator[StopRequest]:
    """Turn the first SIGINT, SIGTERM or SIGUSR1 into a request; a second SIGINT ends at once.

    Only in the main thread; the handlers before are put back at the end.
    """
    request = StopRequest()

    def ask(number: int, frame: FrameType | None) -> None:
        if number == signal.SIGINT and request.signal == signal.SIGINT:
            raise KeyboardInterrupt
        request.signal = number

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, *_ORDERLY)}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
