r"""Adaptive coherence measure (Dogonasheva et al. 2021): coherence after each node's own delay.

    chi^2 = Var_t( <u_i>_i ) / < Var_t u_i >_i ,
    R^2   = max over delays of chi^2( u_i(t + delay_i) ) ,      L = number of different delays.

O. Dogonasheva, D. Kasatkin, B. Gutkin, D. Zakharov, Chaos Solitons Fractals 153, 111541 (2021),
doi:10.1016/j.chaos.2021.111541. As in the authors' program, the maximum is not searched for: the
delay of a node is its first rise through a threshold, in the first half of the record.

R^2 is near 1 for a synchronous state (L = 1), clusters (L of them) and travelling waves (L near N),
near 0 for an asynchronous state, and between for a chimera.

>>> angle = 2 * np.pi * np.arange(400)[:, None] / 40
>>> adaptive_coherence(np.sin(angle - 2 * np.pi * np.arange(20) / 20))
Coherence(r_squared=1.0, n_delays=20)
>>> adaptive_coherence(np.sin(angle + [0.1, 0.1, 3.0]))[1]
2
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures.checks import Array, node_rows


class Coherence(NamedTuple):
    """R^2 in [0, 1], NaN if no node changes; and the number L of different delays."""

    r_squared: float
    n_delays: int


def adaptive_coherence(u: ArrayLike, threshold: float | None = None) -> Coherence:
    """Adaptive coherence measure of a run.

    Parameters
    ----------
    u : array_like, shape (T, N)
        At least 6 times, and several periods.
    threshold : float, optional
        In the unit of u; default: the middle between the least and the largest value of u.

    Raises
    ------
    BadInput
        A wrong shape, too few times, or values that are not finite.
    """
    rows = node_rows("u", u)
    return run_coherence(rows, rows.mean(axis=1), threshold)


def run_coherence(rows: Array, mean: Array, threshold: float | None = None) -> Coherence:
    """As `adaptive_coherence`, of rows (N, T) and their means (N,)."""
    low, high = float(rows.min()), float(rows.max())
    if rows.shape[1] < 6 or not np.isfinite(low + high):
        raise BadInput("u must hold at least 6 times and be finite")
    delays = _delays(rows, 0.5 * (low + high) if threshold is None else threshold)
    return Coherence(_synchrony(rows, mean, delays), len(np.unique(delays)))


def _delays(rows: Array, threshold: float) -> NDArray[np.int64]:
    """Return the sample of each node's first rise, 0 for the second sample and for none."""
    half = rows.shape[1] // 2
    rises = (rows[:, 1 : half - 1] < threshold) & (rows[:, 2:half] > threshold)
    return np.argmax(rises, axis=1) if rises.shape[1] else np.zeros(len(rows), dtype=np.int64)


def _synchrony(rows: Array, mean: Array, delays: NDArray[np.int64]) -> float:
    """Return chi^2 of the aligned rows."""
    total = np.zeros(rows.shape[1] - int(delays.max()))
    variance: float = _align(rows, delays, mean, total)
    return float((total / len(rows)).var()) * len(rows) / variance if variance else float("nan")


@jit()
def _align(rows: Any, delays: Any, mean: Any, total: Any) -> float:
    """Add the aligned rows, less their means, to total (n,); return the sum of their variances."""
    n = total.size
    variance = 0.0
    for j in range(rows.shape[0]):
        first = energy = 0.0
        for i in range(n):
            x = rows[j, delays[j] + i] - mean[j]
            total[i] += x
            first += x
            energy += x * x
        variance += energy / n - (first / n) * (first / n)
    return variance
