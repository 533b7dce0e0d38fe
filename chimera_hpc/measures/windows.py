"""Time windows that begin and end at maxima of the signal.

A window runs from a maximum to the (n_peaks - 1)-th maximum after it, both samples included. It
holds n_peaks maxima and n_peaks - 1 periods. Consecutive windows share n_overlap maxima.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit

Samples = NDArray[np.int64]


@jit()
def _find_maxima(x: Any, found: Any) -> int:
    """Write the indices of the maxima of x (T,) into found. Return their number."""
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
    """Indices of the local maxima of a signal.

    A maximum is a sample, or a run of equal samples, with a smaller sample on either side. A run (a
    plateau) gives one index, that of its middle, rounded down. The first and the last sample of the
    signal are never maxima.

    x (T,) must be finite. Returns an increasing array of int64.

    >>> maxima(np.array([0.0, 1.0, 0.0, 2.0, 2.0, 1.0, 3.0]))
    array([1, 3])
    """
    found = np.empty(max(x.size // 2, 1), dtype=np.int64)
    return found[: _find_maxima(x, found)]


def windows(peaks: Samples, n_peaks: int, n_overlap: int) -> tuple[Samples, Samples]:
    """First and last sample of each complete window over a list of maxima.

    peaks: indices of the maxima, in increasing order.
    n_peaks, n_overlap: maxima per window, and maxima that consecutive windows share; 0 <= n_overlap
        < n_peaks.

    Returns first and last, both (q,); q = 0 where there are fewer than n_peaks maxima.

    >>> windows(np.array([10, 20, 30, 40, 50, 60]), n_peaks=3, n_overlap=1)
    (array([10, 30]), array([30, 50]))
    """
    step = n_peaks - n_overlap
    last = peaks[n_peaks - 1 :: step]
    return peaks[::step][: last.size], last
