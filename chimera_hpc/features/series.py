"""Kept series: from the sampled rows of a run to the integers that are stored."""

from __future__ import annotations

from typing import Any

import numpy as np

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
