"""Thresholds along a chain of points, and hysteresis between its two directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Threshold:
    """Where a chain passes from one class, or one level, to another."""

    between: tuple[str, str]
    """Before and after, in the direction of the chain."""
    interval: tuple[float, float]
    """The two neighbouring values of the axis, the smaller one first."""

    @property
    def at(self) -> float:
        """Middle of the interval."""
        return 0.5 * (self.interval[0] + self.interval[1])


def class_thresholds(x: ArrayLike, classes: Sequence[str | None]) -> list[Threshold]:
    """Return the steps between points of different classes, in the direction of the chain.

    Points without a class are left out, so that a step may be wider than those of the axis.

    >>> class_thresholds([1.0, 2.0, 3.0], ["ordered", None, "chimera"])[0].interval
    (1.0, 3.0)
    """
    known = [(v, name) for v, name in zip(np.asarray(x).tolist(), classes, strict=True) if name]
    return [
        Threshold((a, b), (min(u, v), max(u, v))) for (u, a), (v, b) in pairwise(known) if a != b
    ]


def largest_step(x: ArrayLike, order: ArrayLike) -> Threshold | None:
    """Return the step with the largest change of an order parameter; None below two numbers.

    Of equal changes the first counts.

    >>> largest_step([1.0, 2.0, 3.0], [0.1, 0.2, 0.9]).interval
    (2.0, 3.0)
    """
    values, levels = np.asarray(x, dtype=np.float64), np.asarray(order, dtype=np.float64)
    known = np.flatnonzero(np.isfinite(levels))
    if len(known) < 2:
        return None
    k = int(np.argmax(np.abs(np.diff(levels[known]))))
    ends = values[known[k : k + 2]]
    names = [f"{level:.4g}" for level in levels[known[k : k + 2]]]
    return Threshold((names[0], names[1]), (float(ends.min()), float(ends.max())))


def band(found: Sequence[Threshold]) -> dict[str, float | list[float] | int]:
    """Return the median of thresholds, the band that holds all their intervals, and their number.

    >>> band([Threshold(("a", "b"), (1.0, 2.0)), Threshold(("a", "b"), (2.0, 3.0))])
    {'at': 2.0, 'interval': [1.0, 3.0], 'chains': 2}
    """
    ends: NDArray[np.float64] = np.array([threshold.interval for threshold in found])
    return {
        "at": float(np.median(ends.mean(axis=1))),
        "interval": [float(ends[:, 0].min()), float(ends[:, 1].max())],
        "chains": len(found),
    }
