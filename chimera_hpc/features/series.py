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
        The series, node by node.
    out : int16, shape (T, N)
    """
    n_nodes, n_times = rows.shape
    limit = -(missing + 1.0)
    # Tiles, because one side of the transposition is always read or written across.
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for i in range(n_nodes):
            for t in range(first, last):
                # Compared before it is an integer: the integer of a NaN is anything.
                steps = np.rint(rows[i, t] / scale)
                out[t, i] = int(steps) if abs(steps) <= limit else missing


def by_node(rows: NDArray[np.float64], out: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `rows` (n, T) so that each row is contiguous: in `out`, unless they are already."""
    if rows.flags.c_contiguous:
        return rows
    _transpose(rows.T, out)
    return out


@jit()
def _transpose(samples: Any, out: Any) -> None:
    n_times, n_rows = samples.shape
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for i in range(n_rows):
            for t in range(first, last):
                out[i, t] = samples[t, i]
