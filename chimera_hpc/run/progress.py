"""The progress of a run: a bar on a terminal, plain lines elsewhere, the same lines in run.log."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

LINE_SECONDS = 10.0
"""Plain lines come this often, and at the end."""
_STEADY_BLOCKS = 5
"""Blocks per worker, the first one included, after which the rate is counted by the clock."""


class Reporter:
    """Counts points as blocks end and shows the count, the rate and the time to go."""

    def __init__(
        self,
        total: int,
        log: Path | None = None,
        stream: TextIO | None = None,
        workers: int = 1,
    ) -> None:
        """Count up to ``total`` points of `workers`; ``log`` gets a copy of every line."""
        self.total, self.done, self.failed = total, 0, 0
        self._pace = _Pace(workers)
        self._started = self._last_line = time.monotonic()
        self._stream = stream or sys.stderr
        self._log = log.open("a", encoding="utf-8") if log is not None else None
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Self:
        if self._stream.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                TextColumn,
                TimeElapsedColumn,
            )

            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[rate]}"),
                TextColumn("ETA {task.fields[left]}"),
                TextColumn("elapsed"),
                TimeElapsedColumn(),
                console=Console(file=self._stream),
            )
            self._task = self._bar.add_task(
                "points", total=self.total, completed=0, rate="", left="-"
            )
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away and close the log."""
        self.close()

    def close(self) -> None:
        """Take the bar away and close the log."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        if self._log is not None:
            with suppress(OSError):
                self._log.close()
            self._log = None

    def grow(self, total: int) -> None:
        """Count up to another total."""
        self.total = total
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, total=total)

    def count(self, done: int, failed: int) -> None:
        """Set the number of points that need no more work, and of those that failed."""
        self.done, self.failed = done, failed
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done)

    def say(self, line: str) -> None:
        """Write a line for people, and with its time into the log."""
        if self._bar is not None:
            self._bar.console.print(line, highlight=False, markup=False)
        else:
            # A full disk, or a reader that is gone, is no reason to stop computing.
            with suppress(OSError):
                print(line, file=self._stream, flush=True)
        self.note(line)

    def note(self, line: str) -> None:
        """Write a line into the log only."""
        if self._log is not None:
            stamp = datetime.now(UTC).isoformat(timespec="seconds")
            with suppress(OSError):
                self._log.write(f"{stamp} {line}\n")
                self._log.flush()

    def add(self, n_done: int, n_failed: int, seconds: float = 0.0) -> None:
        """Count the points of a block that has ended after `seconds` of work."""
        now = time.monotonic()
        self.done += n_done + n_failed
        self.failed += n_failed
        rate = self._pace.add(n_done + n_failed, seconds, now)
        left = duration(max(0, self.total - self.done) / rate) if rate else "-"
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=self.done, rate=f"{rate:.1f}/s", left=left)
        elif (rate and now - self._last_line > LINE_SECONDS) or self.done >= self.total:
            self._last_line = now
            failures = f", {self.failed} failed" if self.failed else ""
            self.say(
                f"{self.done} of {self.total} points{failures}, {rate:.1f} points/s, "
                f"elapsed {duration(now - self._started)}, ETA {left}"
            )


class _Pace:
    """The rate at which points come, from the blocks that have ended.

    The first block of each worker takes longer, because the worker loads its kernels. It counts
    only until there are others. As long as these are few, most work is in blocks that have not
    ended; the rate is then that of one worker times the number of workers.
    """

    def __init__(self, workers: int) -> None:
        self._workers, self._ended = workers, 0
        self._points, self._work, self._began = 0, 0.0, 0.0

    def add(self, points: int, seconds: float, now: float) -> float:
        """Count a block that ended `now`; return points per second, 0 if none is known yet."""
        self._ended += 1
        if self._ended == self._workers + 1:
            self._points, self._work = 0, 0.0
        self._points, self._work = self._points + points, self._work + seconds
        if self._ended == self._workers:
            self._began = now
        if self._ended > _STEADY_BLOCKS * self._workers:
            return self._points / max(now - self._began, 1e-9)
        return self._workers * self._points / max(self._work, 1e-9)


def duration(seconds: float) -> str:
    """Return a time as hours, minutes and seconds, or with days before them: ``1 d 02:03:04``."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    days, h = divmod(hours, 24)
    return (f"{days} d " if days else "") + f"{h:02}:{m:02}:{s:02}"
