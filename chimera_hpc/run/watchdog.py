"""A thread that notices when a model does not return, and then ends or replaces the process.

A compiled right-hand side cannot be interrupted by a signal or an exception. It releases the GIL,
so a thread can still record the reason in the claims and end the process. A request to stop ends it
too, if the model does not let Python take the signal.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, NoReturn

from chimera_hpc.base.exits import Exit
from chimera_hpc.base.foreign import first_entry
from chimera_hpc.run.signals import STOP_SIGNALS, exit_status

if TYPE_CHECKING:
    from chimera_hpc.job import Sweep

_LOOK_SECONDS = 0.5
_GRACE_SECONDS = 5.0
"""Time for a call of the model to return after a signal; far more than the integrator takes."""
_LIMIT = "(integrator.time_out + run.patience)"


def say(text: str, what: str = "error") -> None:
    """Write what has happened to the standard error output."""
    sys.stderr.write(f"{what}: {text}\n")
    sys.stderr.flush()


def give_up(text: str) -> NoReturn:
    """End this process with one line, because it cannot continue."""
    say(text)
    os._exit(Exit.BAD_INPUT)


class Watchdog:
    """Checks whether a call of a user's code takes longer than a limit. One per process."""

    def __init__(self) -> None:
        self._sweep: Sweep
        self.on_hang: Callable[[str], object] = say
        """Called in the watchdog's thread with what has happened, on one line."""
        self.on_stop: Callable[[], object] = lambda: None
        """Called there before a signal ends this process in the middle of a call."""
        self._thread: threading.Thread | None = None
        self._signals: int | None = None
        self._heard: list[int] = []

    def listen(self) -> None:
        """Receive signals while a model prevents Python from handling them; main thread only."""
        self._signals, out = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(out, warn_on_full_buffer=False)
        os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))

    def watch(self, sweep: Sweep) -> None:
        """Watch over the calls of this sweep's model from now on."""
        self._sweep = sweep
        # A forked process has this object without its thread.
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._look, daemon=True)
            self._thread.start()

    def _look(self) -> None:
        pause = threading.Event()
        entry: float | None = None
        spent, late, last = 0.0, 0.0, time.monotonic()
        while spent <= limit_of(self._sweep):
            pause.wait(_LOOK_SECONDS)
            before, entry, now = entry, first_entry(), time.monotonic()
            # A process that was stopped for a while has not spent that time in the call.
            passed = min(now - last, 2 * _LOOK_SECONDS)
            same = entry is not None and entry == before
            spent = spent + passed if same else 0.0
            late = late + passed if same and self._asked_to_stop() else 0.0
            if late > _GRACE_SECONDS:
                self._stop()
            last = now
        limit = limit_of(self._sweep)
        self.on_hang(f"model: {self._sweep.model} did not return within {limit:.4g} s {_LIMIT}")

    def _asked_to_stop(self) -> bool:
        if self._signals is not None:
            with suppress(BlockingIOError):
                self._heard += os.read(self._signals, 64)
        return not STOP_SIGNALS.isdisjoint(self._heard)

    def _stop(self) -> NoReturn:
        self.on_stop()
        say(f"{self._sweep.model} does not return; the same command goes on", "stopped")
        os._exit(exit_status(self._heard))


watchdog = Watchdog()


def limit_of(sweep: Sweep) -> float:
    """Return after how many seconds a call of the model is given up."""
    return sweep.integrator.time_out + sweep.run.patience
