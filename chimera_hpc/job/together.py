"""The points of several sweeps in one list, as in a store that was extended."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.job.points import Points
from chimera_hpc.job.spec import Sweep


def points_of(sweeps: Sequence[Sweep]) -> Points:
    """Return the points of the first sweep, then the new ones of each later sweep."""
    points = sweeps[0].points()
    for sweep in sweeps[1:]:
        points = _appended(points, sweep.points())
    return points


def _appended(points: Points, more: Points) -> Points:
    new = ~np.isin(point_keys(more, points), point_keys(points))
    columns = {
        name: np.concatenate([column, more.columns[name][new]])
        for name, column in points.columns.items()
    }
    return Points(columns, more.axes)


def point_keys(points: Points, like: Points | None = None) -> NDArray[np.void]:
    """Return each point as its bytes, in the order of the columns of `like`."""
    # Adding 0 turns -0.0 into 0.0, which is the same parameter.
    rows = [(points.columns[name] + 0).view(np.int64) for name in (like or points).columns]
    table = np.ascontiguousarray(np.stack(rows, axis=1))
    keys: NDArray[np.void] = table.view(np.dtype((np.void, 8 * len(rows))))[:, 0]
    return keys
