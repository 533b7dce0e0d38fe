"""Series: from the order in which they are sampled to that of the features, and to integers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate._jit import jit

_TILE = 64


@jit()
def quantise(rows: Any, scale: float, missing: int, out: Any) -> None:
    """Write a series as integers: ``out[t, i] = round(rows[i, t] / scale)``.

    A value that is NaN or needs more than ``-missing - 1`` steps becomes ``missing``.

    Parameters
    ----------
    rows : shape (N, T)
        The series, node by node; in memory best time by time, as the integrator leaves it.
    out : int16, shape (T, N)
    """
    n_nodes, n_times = rows.shape
    limit = -(missing + 1.0)
    for t in range(n_times):
        for i in range(n_nodes):
            # Compared before it is an integer: the integer of a NaN is anything.
            steps = np.rint(rows[i, t] / scale)
            out[t, i] = int(steps) if abs(steps) <= limit else missing


@jit()
def round_to(rows: Any, scale: float, out: Any) -> None:
    """Write a series, shape (N, T), rounded to whole steps: ``round(rows / scale) * scale``."""
    n_nodes, n_times = rows.shape
    for i in range(n_nodes):
        for t in range(n_times):
            out[i, t] = np.rint(rows[i, t] / scale) * scale


def by_node(rows: NDArray[np.float64], out: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `rows` (n, T) so that each row is contiguous: in `out`, unless they are already."""
    if rows.flags.c_contiguous:
        return rows
    _transpose(rows.T, out)
    return out


@jit()
def _transpose(samples: Any, out: Any) -> None:
    # Tiles, because one side of the transposition is always read or written across.
    n_times, n_rows = samples.shape
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for i in range(n_rows):
            for t in range(first, last):
                out[i, t] = samples[t, i]
