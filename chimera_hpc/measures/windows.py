"""Time windows that follow the signal: they begin and end at its maxima.

A window runs from a maximum to the (n_peaks - 1)-th maximum after it, both samples included, so
it holds n_peaks maxima and n_peaks - 1 periods; consecutive windows share n_overlap maxima.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit

Samples = NDArray[np.int64]


@jit()
def _find_maxima(x: Any, found: Any) -> int:
    """Write the places of the maxima of x (T,) into found and return their number."""
    count = 0
    i = 1
    while i < x.size - 1:
        if x[i - 1] < x[i]:
            end = i
            while end < x.size - 1 and x[end + 1] == x[i]:
                end += 1
            if end < x.size - 1 and x[end + 1] < x[i]:
                found[count] = (i + end) // 2
                count += 1
            i = end
        i += 1
    return count


def maxima(x: NDArray[np.float64]) -> Samples:
    """Places of the local maxima of a signal.

    A maximum is a run of equal samples with a smaller one on either side; a run longer than one
    sample (a plateau) counts once, at its middle, rounded down. The first and the last sample of
    the signal are never maxima.

    Parameters
    ----------
    x : ndarray, shape (T,)
        Samples, finite.

    Returns
    -------
    ndarray of int64, rising

    Examples
    --------
    >>> maxima(np.array([0.0, 1.0, 0.0, 2.0, 2.0, 1.0, 3.0]))
    array([1, 3])
    """
    found = np.empty(max(x.size // 2, 1), dtype=np.int64)
    return found[: _find_maxima(x, found)]


def windows(peaks: Samples, n_peaks: int, n_overlap: int) -> tuple[Samples, Samples]:
    """First and last sample of each complete window over a list of maxima.

    Parameters
    ----------
    peaks : ndarray of int64
        Places of the maxima, rising.
    n_peaks, n_overlap : int
        Maxima in a window, and maxima that consecutive windows share; 0 <= n_overlap < n_peaks.

    Returns
    -------
    first, last : ndarray of int64, shape (q,)
        q = 0 where there are fewer than n_peaks maxima.

    Examples
    --------
    >>> windows(np.array([10, 20, 30, 40, 50, 60]), n_peaks=3, n_overlap=1)
    (array([10, 30]), array([30, 50]))
    """
    step = n_peaks - n_overlap
    last = peaks[n_peaks - 1 :: step]
    return peaks[::step][: last.size], last
