"""The stability domain of an equilibrium: f(P, R) of the paper (fig. 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.classify.tree import Floats, Integers


@dataclass(frozen=True)
class BasinMap:
    """Fraction of runs that end inside the ball in which they started."""

    half_degree: Integers
    """(n_P,), increasing"""
    radius: Floats
    """(n_R,), increasing"""
    inside: Integers
    """(n_P, n_R): runs that ended inside."""
    trials: Integers
    """(n_P, n_R): runs with a result."""
    fraction: Floats
    """(n_P, n_R): inside / trials; NaN where there is no run."""

    def safe_radius(self, level: float = 1.0) -> Floats:
        """Return for each P the largest radius up to which f never falls below `level`.

        NaN where f at the smallest radius is below `level`.
        """
        holds = np.logical_and.accumulate(self.fraction >= level, axis=1).sum(axis=1)
        return np.where(holds > 0, self.radius[np.maximum(holds, 1) - 1], np.nan)


def basin_map(
    half_degree: ArrayLike, radius: ArrayLike, inside: ArrayLike, counted: ArrayLike | None = None
) -> BasinMap:
    """Count runs by P and R. All arguments are (n,), one entry per run.

    `inside` is true where the final distance from the equilibrium is at most R. Runs where
    `counted` is false (no result) are left out.
    """
    kept = slice(None) if counted is None else np.asarray(counted, dtype=np.bool_)
    degrees, row = np.unique(np.asarray(half_degree, dtype=np.int64), return_inverse=True)
    radii, column = np.unique(np.asarray(radius, dtype=np.float64), return_inverse=True)
    trials = np.zeros((len(degrees), len(radii)), dtype=np.int64)
    hits = np.zeros_like(trials)
    np.add.at(trials, (row[kept], column[kept]), 1)
    np.add.at(hits, (row[kept], column[kept]), np.asarray(inside, dtype=np.bool_)[kept])
    fraction = np.where(trials > 0, hits / np.maximum(trials, 1), np.nan)
    return BasinMap(degrees, radii, hits, trials, fraction)
