"""The points of several sweeps in one list, as in a store that was extended."""

from __future__ import annotations

from collections.abc import Sequence

from chimera_hpc.job.points import Points, appended
from chimera_hpc.job.spec import Sweep


def points_of(sweeps: Sequence[Sweep]) -> Points:
    """Return the points of the first sweep, then the new ones of each later sweep."""
    points = sweeps[0].points()
    for sweep in sweeps[1:]:
        points = appended(points, sweep.points())
    return points
