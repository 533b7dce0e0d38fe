"""Clean stops: the signals of users and batch systems."""

from __future__ import annotations

import signal
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from types import FrameType

from chimera_hpc.base.exits import Exit

STOP_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM, signal.SIGUSR1, signal.SIGHUP})


def exit_status(asked: Collection[int]) -> Exit:
    """Return the status to leave with when these signals ended unfinished work."""
    return Exit.INTERRUPTED if signal.SIGINT in asked else Exit.MORE_TO_DO


class StopRequest:
    """Whether a signal asked to stop, and which exit status it leads to."""

    def __init__(self) -> None:
        self.asked: list[int] = []
        self.in_order = False
        self.broke_off = False
        """Whether a signal raised KeyboardInterrupt; other packages may turn that into an error."""

    def __call__(self) -> bool:
        return bool(self.asked)

    @property
    def exit_status(self) -> Exit:
        """Status to leave with when the work was not finished."""
        return exit_status(self.asked)

    @contextmanager
    def good_order(self) -> Iterator[None]:
        """Let the work inside end by asking this object; elsewhere a signal breaks off at once."""
        self.in_order = True
        try:
            yield
        finally:
            self.in_order = False

    def take(self, number: int, frame: FrameType | None = None) -> None:
        """Note a signal; raise KeyboardInterrupt outside of good order, and at a second Ctrl-C."""
        again = number == signal.SIGINT and bool(self.asked)
        self.asked.append(number)
        if again or not self.in_order:
            self.broke_off = True
            raise KeyboardInterrupt


@contextmanager
def stop_request() -> Iterator[StopRequest]:
    """Turn SIGINT, SIGTERM, SIGUSR1 and SIGHUP into a request.

    Only in the main thread. A signal that the caller has ignored (nohup, a job in the background)
    stays so; the handlers before are put back at the end.
    """
    request = StopRequest()
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    taken = [number for number, handler in before.items() if handler != signal.SIG_IGN]
    for number in taken:
        signal.signal(number, request.take)
    try:
        yield request
    finally:
        for number in taken:
            signal.signal(number, before[number])
