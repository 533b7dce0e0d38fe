"""Where two classes have equally many votes, by a model of their share along an axis.

Cells near a boundary may stay undecided with many runs: their votes are nearly equal. They tell all
the better where the shares cross. The share of the upper class among the votes for either is taken
to rise as a logistic function,

    share(x) = 1 / (1 + exp(-k (x - x0))), k > 0,

fitted by maximum likelihood. The interval of x0 holds all values whose profile likelihood ratio
2 (log L(best) - log L(x0)) is at most the quantile of chi^2 with one degree of freedom (Wilks 1938,
doi:10.1214/aoms/1177732360). Rounds that stop when a cell is decided leave the likelihood as it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, log_expit

_PLACES = 101
_SLOPES = 40


def crossing(
    values: ArrayLike, below: ArrayLike, above: ArrayLike, confidence: float
) -> tuple[float, float, float]:
    """Return where the shares cross, and the ends of its interval, within the values.

    values: (n_cells,) rising, of the axis.
    below, above: (n_cells,) votes for the class below the crossing and for the one above.
    """
    x, low, high = (np.asarray(each, dtype=np.float64) for each in (values, below, above))
    slopes = np.geomspace(1.0 / (x[-1] - x[0]), 40.0 / np.diff(x).min(), _SLOPES)
    first, last = x[0], x[-1]
    for _ in range(2):  # the second time where the first one has found it
        places, step = np.linspace(first, last, _PLACES, retstep=True)
        z = slopes[:, None, None] * (x - places[:, None])
        likelihood = (high * log_expit(z) + low * log_expit(-z)).sum(axis=2).max(axis=0)
        short = likelihood.max() - likelihood
        held = places[2.0 * short <= chdtri(1, 1.0 - confidence)]
        first, last = max(x[0], held[0] - step), min(x[-1], held[-1] + step)
    best = places[short < 1e-6]
    return float((best[0] + best[-1]) / 2.0), float(held[0]), float(held[-1])
