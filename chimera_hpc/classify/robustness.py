"""Fractions of runs along a parameter, with Wilson bands: W(Q_r) of the paper (fig. 19)."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.classify.tree import Floats, Integers


def wilson_interval(
    hits: ArrayLike, trials: ArrayLike, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Return the score interval for a binomial fraction; (0, 1) where there is no trial.

    centre = (p + z^2/2n) / (1 + z^2/n), half-width = z/(1 + z^2/n) sqrt(p(1-p)/n + z^2/4n^2),
    with p = hits/n and z the normal quantile (Wilson 1927, doi:10.1080/01621459.1927.10502953).
    """
    count = np.asarray(trials, dtype=np.float64)
    n = np.maximum(count, 1.0)
    p = np.asarray(hits, dtype=np.float64) / n
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    shrink = 1.0 + z * z / n
    centre = (p + 0.5 * z * z / n) / shrink
    half = z / shrink * np.sqrt(p * (1.0 - p) / n + 0.25 * (z / n) ** 2)
    # The formula gives exactly 0 and 1 here; rounding leaves 1e-17.
    low = np.where((p == 0.0) | (count == 0), 0.0, centre - half)
    high = np.where((p == 1.0) | (count == 0), 1.0, centre + half)
    return low, high


@dataclass(frozen=True)
class FractionCurve:
    """Fraction of runs that hit, for each value of a parameter."""

    x: Floats
    """(k,) parameter values, increasing."""
    hits: Integers
    trials: Integers
    fraction: Floats
    """hits / trials; NaN where there is no trial."""
    low: Floats
    high: Floats

    def holds_until(self, level: float = 1.0) -> float | None:
        """Return the largest x up to which the fraction never falls below `level`, if any."""
        below = np.flatnonzero(~(self.fraction >= level))
        n_good = int(below[0]) if len(below) else len(self.x)
        return float(self.x[n_good - 1]) if n_good else None

    def to_dict(self) -> dict[str, list[float]]:
        """Return plain lists, for results.json."""
        return {name: getattr(self, name).tolist() for name in self.__dataclass_fields__}


def fraction_curve(
    x: ArrayLike, hit: ArrayLike, counted: ArrayLike | None = None, confidence: float = 0.95
) -> FractionCurve:
    """Group runs by their value of x (n,) and count those where `hit` (n,) is true.

    Runs where `counted` (n,) is false (no result) are left out. For W(Q_r), `hit` means that the
    class is chimera, so a steady run is a trial without a hit.
    """
    values, position = np.unique(np.asarray(x, dtype=np.float64), return_inverse=True)
    keep: NDArray[np.bool_] = (
        np.ones(len(position), dtype=np.bool_)
        if counted is None
        else np.asarray(counted, dtype=np.bool_)
    )
    trials = np.bincount(position[keep], minlength=len(values))
    hits = np.bincount(position[keep & np.asarray(hit, dtype=np.bool_)], minlength=len(values))
    low, high = wilson_interval(hits, trials, confidence)
    fraction = np.where(trials > 0, hits / np.maximum(trials, 1), np.nan)
    return FractionCurve(values, hits, trials, fraction, low, high)
