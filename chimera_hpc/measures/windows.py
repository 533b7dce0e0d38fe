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
def _find_maxima(x: Any, prominence: float, found: Any) -> int:
    """Write the indices of the first maxima of x (T,) into found. Return their number."""
    count = 0
    i = 1
    while i < x.size - 1 and count < found.size:
        if x[i - 1] < x[i]:
            end = i
            while end < x.size - 1 and x[end + 1] == x[i]:
                end += 1
            if end < x.size - 1 and x[end + 1] < x[i]:
                found[count] = (i + end) // 2
                count += 1 if prominence <= 0.0 or _stands_out(x, i, end, prominence) else 0
            i = end
        i += 1
    return count


@jit()
def _stands_out(x: Any, first: int, last: int, prominence: float) -> bool:
    """Whether x falls by `prominence` on both sides of x[first:last+1] before it is higher."""
    top = x[first]
    i = first - 1
    while i >= 0 and x[i] <= top and top - x[i] < prominence:
        i -= 1
    if i < 0 or x[i] > top:
        return False
    i = last + 1
    while i < x.size and x[i] <= top and top - x[i] < prominence:
        i += 1
    fell: bool = i < x.size and x[i] <= top
    return fell


def maxima(x: NDArray[np.float64], prominence: float = 0.0, at_most: int | None = None) -> Samples:
    """Indices of the local maxima of a signal.

    A maximum is a sample, or a run of equal samples, with a smaller sample on either side. A run (a
    plateau) gives one index, that of its middle, rounded down. The first and the last sample of the
    signal are never maxima.

    x (T,) must be finite. Returns an increasing array of int64.

    prominence: least height over the higher of the two lowest samples between the maximum and the
        next higher sample, or the end, on either side. 0: all maxima.
    at_most: number of maxima, from the first, after which the search ends.

    >>> maxima(np.array([0.0, 1.0, 0.0, 2.0, 2.0, 1.0, 3.0]))
    array([1, 3])
    """
    most = max(x.size // 2, 1)
    found = np.empty(most if at_most is None else min(most, at_most), dtype=np.int64)
    return found[: _find_maxima(x, prominence, found)]


def hidden_windows(
    signals: NDArray[np.float64], n_peaks: int, prominence: float
) -> NDArray[np.bool_]:
    """Whether each of signals (N, T) has windows, but none with the limit `prominence`."""
    counts = [(len(maxima(x, prominence)), len(maxima(x))) for x in signals]
    return np.array([few < n_peaks <= many for few, many in counts])


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


def place_windows(
    references: NDArray[np.float64],
    prominence: float,
    n_peaks: int,
    n_overlap: int,
    max_windows: int,
) -> tuple[Samples, Samples, Samples]:
    """Return first and last samples (C, q) and counts (C,) of the windows of C signals (C, T).

    Samples after a signal's last window are 0. prominence is that of `maxima`, n_peaks and
    n_overlap are those of `windows`; max_windows counts from the first window, 0: all.
    """
    needed = n_peaks + (max_windows - 1) * (n_peaks - n_overlap) if max_windows else None
    peaks = [maxima(x, prominence, needed) for x in references]
    placed = [windows(found, n_peaks, n_overlap) for found in peaks]
    counts = np.array([last.size for _, last in placed])
    first = np.zeros((len(placed), counts.max()), dtype=np.int64)
    last = np.zeros_like(first)
    for row, (begins, ends) in enumerate(placed):
        first[row, : begins.size] = begins
        last[row, : ends.size] = ends
    return first, last, counts
