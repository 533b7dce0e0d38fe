"""A thread that notices when a model does not return, and then ends or replaces the process.

A compiled right-hand side cannot be interrupted: no signal and no exception gets into it. It
releases the GIL, so a thread can do what is left to do: leave word at the claims, and end the
process.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn

from chimera_hpc.base.exits import Exit
from chimera_hpc.base.foreign import first_entry

if TYPE_CHECKING:
    from chimera_hpc.job import Sweep

_LOOK_SECONDS = 0.5
_LIMIT = "(integrator.time_out + run.patience)"


def say(text: str) -> None:
    """Write what has happened to the standard error output."""
    sys.stderr.write(f"error: {text}\n")
    sys.stderr.flush()


def give_up(text: str) -> NoReturn:
    """End this process, which can do nothing else any more, with one line."""
    say(text)
    os._exit(Exit.BAD_INPUT)


class Watchdog:
    """Looks whether a call of a user's code takes longer than a limit. One for each process."""

    def __init__(self) -> None:
        self._sweep: Sweep
        self.on_hang: Callable[[str], object] = say
        """Called in the watchdog's thread with what has happened, on one line."""
        self._thread: threading.Thread | None = None

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
        spent, last = 0.0, time.monotonic()
        while spent <= limit_of(self._sweep):
            pause.wait(_LOOK_SECONDS)
            before, entry, now = entry, first_entry(), time.monotonic()
            # A process that was stopped for a while has not spent that time in the call.
            passed = min(now - last, 2 * _LOOK_SECONDS)
            spent = spent + passed if entry is not None and entry == before else 0.0
            last = now
        limit = limit_of(self._sweep)
        self.on_hang(f"model: {self._sweep.model} did not return within {limit:.4g} s {_LIMIT}")


watchdog = Watchdog()


def limit_of(sweep: Sweep) -> float:
    """Return after how many seconds a call of the model is given up."""
    return sweep.integrator.time_out + sweep.run.patience
