"""Time series: transposition to contiguous nodes, and rounding to integers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit

Array = NDArray[np.float64]

# Times per block of a transposition, for which one side is not contiguous.
_TILE = 64


def quantise(
    rows: Array, scale: float, missing: int, stored: NDArray[np.int16], back: Array
) -> int:
    """Write a series as integers, ``round(rows / scale)``, and the values that these represent.

    A value that is NaN or needs more than ``-missing - 1`` steps is stored as ``missing``.

    rows (N, T): the series. Fastest if it is contiguous in the nodes, as the integrator writes it.
    stored (T, N): int16
    back (N, T): set to ``stored * scale``.

    Returns the number of missing values. Their entries in ``back`` are undefined.
    """
    number: int = _quantise(*_time_by_time(rows), scale, missing, stored, back)
    return number


@jit()
def round_to(rows: Any, scale: float, out: Any) -> None:
    """Write a series, shape (N, T), rounded to whole steps: ``round(rows / scale) * scale``."""
    n_nodes, n_times = rows.shape
    for i in range(n_nodes):
        for t in range(n_times):
            out[i, t] = np.rint(rows[i, t] / scale) * scale


def by_node(rows: Array, out: Array) -> Array:
    """Return `rows` (n, T) with contiguous rows. They are copied to `out` if necessary."""
    if rows.flags.c_contiguous:
        return rows
    _turn(*_time_by_time(rows), out)
    return out


def _time_by_time(rows: Array) -> tuple[Array, int]:
    """Return rows (n, T) as a flat array, and its stride from one time to the next.

    Kernels can then read rows of another array without a copy, with contiguous neighbours.
    """
    n, n_times = rows.shape
    size = rows.itemsize
    if rows.strides[0] != size or rows.strides[1] < n * size or rows.strides[1] % size:
        return np.ascontiguousarray(rows.T).reshape(-1), n
    step = rows.strides[1] // size
    whole = np.lib.stride_tricks.as_strided(rows, ((n_times - 1) * step + n,), (size,))
    return whole, step


@jit()
def _quantise(line: Any, step: int, scale: float, missing: int, stored: Any, back: Any) -> int:
    n_times, n_nodes = stored.shape
    limit = -(missing + 1.0)
    lost = 0
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for t in range(first, last):
            here, out = line[t * step : t * step + n_nodes], stored[t]
            for i in range(n_nodes):
                # Compared before the conversion, because the integer of a NaN is undefined.
                steps = np.rint(here[i] / scale)
                fits = abs(steps) <= limit
                lost += 0 if fits else 1
                out[i] = np.int32(steps) if fits else missing
        for i in range(n_nodes):
            for t in range(first, last):
                back[i, t] = stored[t, i] * scale
    return lost


@jit()
def _turn(line: Any, step: int, out: Any) -> None:
    n_nodes, n_times = out.shape
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for i in range(n_nodes):
            for t in range(first, last):
                out[i, t] = line[t * step + i]
