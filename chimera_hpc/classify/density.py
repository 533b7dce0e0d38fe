"""Classes of one scalar from its density: sigma_l of the paper (fig. 23)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.naming import CLASSES
from chimera_hpc.classify.tree import Floats, Integers

_GRID = 1024


@dataclass(frozen=True)
class DensityClasses:
    """A kernel density estimate, its modes, and the classes between its minima."""

    bandwidth: float
    grid: Floats
    """(g,) abscissae"""
    density: Floats
    """(g,) density on the grid; its integral is 1."""
    modes: Floats
    """(k,) abscissae of the local maxima, increasing."""
    cuts: Floats
    """(k - 1,) abscissae of the minima between neighbouring modes."""
    labels: Integers
    """(n,) class of each value: the number of cuts below it; -1 where the value is not finite."""
    names: tuple[str, ...]
    """(k,) the names for three classes, else class-1, class-2, ..."""


def bandwidth_by_rule(values: Floats) -> float:
    """Return Silverman's bandwidth 0.9 min(s, IQR / 1.34) n^(-1/5).

    Silverman 1986, Density Estimation for Statistics and Data Analysis, eq. (3.31). If all values
    are equal, the bandwidth is 1e-3 of their modulus, or 1e-3 if they are 0.
    """
    low, high = np.percentile(values, [25.0, 75.0])
    spreads = [s for s in (float(np.std(values, ddof=1)), float(high - low) / 1.34) if s > 0.0]
    if not spreads:
        return 1e-3 * max(abs(float(values[0])), 1.0)
    return float(0.9 * min(spreads) * len(values) ** -0.2)


def density_classes(
    values: ArrayLike, bandwidth: float | None = None, *, names: Sequence[str] = CLASSES
) -> DensityClasses:
    """Class values (n,) by the modes of their Gaussian kernel density estimate.

    f(x) = 1/(n h) sum_i phi((x - x_i)/h) on a grid of 1024 points that reaches 3 h beyond the data.
    There is one class per mode of f. The cuts are the minima of f between modes, so no threshold is
    needed. The default `bandwidth` h is Silverman's; `stable_bandwidths` gives the range with the
    same number of modes. Values that are not finite get label -1. Steady runs have sigma_l near 0
    and should be included. Three classes have the `names`, the paper's for its model.

    Raises BadInput: fewer than two finite values, or a bandwidth that is not positive.
    """
    data = np.asarray(values, dtype=np.float64).ravel()
    finite = np.isfinite(data)
    if finite.sum() < 2:
        raise BadInput("density classes need at least two finite values")
    if bandwidth is not None and not bandwidth > 0.0:
        raise BadInput(f"the bandwidth is {bandwidth}; it must be above 0")
    h = bandwidth_by_rule(data[finite]) if bandwidth is None else float(bandwidth)
    grid, density = _estimate(data[finite], h)
    tops = _maxima(density)
    bottoms = [left + int(density[left:right].argmin()) for left, right in pairwise(tops)]
    cuts = grid[bottoms]
    labels = np.where(finite, np.searchsorted(cuts, data), -1)
    numbered = tuple(f"class-{i + 1}" for i in range(len(tops)))
    called = tuple(names) if len(tops) == len(names) else numbered
    return DensityClasses(h, grid, density, grid[tops], cuts, labels, called)


def stable_bandwidths(values: ArrayLike, n_modes: int) -> tuple[float, float]:
    """Return the smallest and the largest bandwidth whose density has `n_modes` modes.

    The number of modes of a Gaussian kernel estimate never increases with the bandwidth (Silverman
    1981, doi:10.1111/j.2517-6161.1981.tb01155.x), so bisection finds both ends, with a relative
    error of 1e-3. The upper end is infinite for one mode. Both ends are equal if no bandwidth gives
    that number. `n_modes` is at least 1.
    """
    data = np.asarray(values, dtype=np.float64).ravel()
    data = data[np.isfinite(data)]
    low = _critical_bandwidth(data, n_modes)
    return low, (_critical_bandwidth(data, n_modes - 1) if n_modes > 1 else float("inf"))


def _critical_bandwidth(data: Floats, n_modes: int) -> float:
    """Return the smallest bandwidth with at most `n_modes` modes; 0 if that holds for all."""
    high = max(float(np.ptp(data)), 1e-12)
    low = 1e-3 * high
    if len(_maxima(_estimate(data, low)[1])) <= n_modes:
        return 0.0
    while high > 1.001 * low:
        middle = float(np.sqrt(low * high))
        too_many = len(_maxima(_estimate(data, middle)[1])) > n_modes
        low, high = (middle, high) if too_many else (low, middle)
    return high


def _estimate(data: Floats, bandwidth: float) -> tuple[Floats, Floats]:
    """Return the grid and the density on it."""
    from sklearn.neighbors import KernelDensity

    reach = 3.0 * bandwidth
    grid = np.linspace(data.min() - reach, data.max() + reach, _GRID)
    model = KernelDensity(kernel="gaussian", bandwidth=bandwidth).fit(data[:, None])
    return grid, np.exp(model.score_samples(grid[:, None]))


def _maxima(density: Floats) -> Integers:
    """Return the local maxima. A plateau, which rounding may cause, gives its first point."""
    slope = np.sign(np.diff(density))
    moving = np.flatnonzero(slope)
    falls = (slope[moving[:-1]] > 0) & (slope[moving[1:]] < 0)
    return (moving[:-1][falls] + 1).astype(np.int64)
