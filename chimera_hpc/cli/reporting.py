"""The reduction and the report of a sweep, at the end of a run and during it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

LIVE_SECONDS = 60.0
"""A run rewrites its report at most this often."""
_LIVE_SHARE = 0.02
"""Share of a run's time that this may take."""
_LIVE_PICTURES = 60
_LIVE_TREE = 2_000
_LIVE_POINTS = 50_000
"""A larger sweep gets its report at the end only: reading all its results takes too long."""
_REDUCING = (
    "chimera_hpc.reduction.reduction",
    "chimera_hpc.reduction.atlases",
    "chimera_hpc.reduction.analyses.ring",
)
"""What every reduction loads, or most of them."""


def reduce_and_report(folder: Path, make_figures: bool) -> None:
    """Make results.json and, unless they are not wanted, figures and report; say where they are.

    Raises what `reduce_sweep` does.
    """
    from chimera_hpc.reduction.reduction import reduce_sweep

    reduce_sweep(folder, make_figures=make_figures, say=print)
    if make_figures:
        from chimera_hpc.report import write_report

        report = write_report(folder)
        print(f"report   {report.path} ({report.size / 1e6:.1f} MB)")


def load_reduction() -> None:
    """Import what reduces a sweep, before it is needed."""
    # An import that fails is heard of when it is needed.
    with suppress(Exception):
        for name in _REDUCING:
            import_module(name)


class LiveReport:
    """The report of a run in progress, rewritten from time to time.

    Nothing is written before `LIVE_SECONDS` have passed, so that short runs don't pay for it; the
    pauses grow with what a report takes.
    """

    def __init__(self, folder: Path, n_points: int) -> None:
        self._folder = folder
        self._wanted = n_points <= _LIVE_POINTS
        self._due = time.monotonic() + LIVE_SECONDS

    def refresh(self, note: Callable[[str], None]) -> None:
        """Write the report if it is time; `note` is told when that fails."""
        began = time.monotonic()
        if not self._wanted or began < self._due:
            return
        from chimera_hpc.base.errors import BadInput
        from chimera_hpc.report import write_report
        from chimera_hpc.store.blocks import DamagedChunk

        try:
            write_report(
                self._folder, most_pictures=_LIVE_PICTURES, replay=False, largest_tree=_LIVE_TREE
            )
        except (BadInput, DamagedChunk, OSError) as error:
            # The run itself will hear of damage and of full disks, and does what can be done.
            note(f"no report for now: {error}")
        now = time.monotonic()
        self._due = now + max(LIVE_SECONDS, (now - began) / _LIVE_SHARE)
