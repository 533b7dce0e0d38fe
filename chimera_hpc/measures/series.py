"""Time series: transposition to contiguous nodes, and rounding to integers.

Long series fill much of the memory, so two signals are transposed in place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit

Array = NDArray[np.float64]

# Times per block of a transposition, for which one side is not contiguous.
_TILE = 64


def quantise(rows: Array, scale: float, missing: int, stored: NDArray[np.int16]) -> int:
    """Write a series as integers, ``round(rows / scale)``, and return how many values are missing.

    A value that is NaN or needs more than ``-missing - 1`` steps is stored as ``missing``.

    rows (N, T): the series. Fastest if it is contiguous in the nodes, as the integrator writes it.
    stored (T, N): int16
    """
    number: int = _quantise(*_time_by_time(rows), scale, missing, stored)
    return number


@jit()
def restore(stored: Any, scale: float, out: Any) -> None:
    """Write the values of integers stored (T, N), ``stored * scale``, node by node (N, T)."""
    n_times, n_nodes = stored.shape
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for i in range(n_nodes):
            for t in range(first, last):
                out[i, t] = stored[t, i] * scale


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


def turn_in_place(u: Array, w: Array) -> tuple[Array, Array] | None:
    """Return room for a signal (N, T), and w with contiguous rows, in the memory of u and w.

    u, w (N, T): time by time, each an array of its own, or parts of the samples of one run, as the
    integrator writes them, with u before w. Both are destroyed. None, and nothing is done, if they
    lie in memory in another way.
    """
    if u.shape != w.shape or u is w or not (u.flags.writeable and w.flags.writeable):
        return None
    if all(x.flags.f_contiguous and x.flags.owndata for x in (u, w)):
        room, turned = (x.T.reshape(u.shape) for x in (w, u))
        _turn(w.T.reshape(-1), len(w), turned)
        return room, turned
    return _turn_half(u, w)


def _turn_half(u: Array, w: Array) -> tuple[Array, Array] | None:
    (n, n_times), size = u.shape, u.itemsize
    (step, odd_step), (gap, odd_gap) = (
        divmod(offset, size) for offset in (u.strides[1], w.ctypes.data - u.ctypes.data)
    )
    apart = n_times > 1 and n <= gap <= step - n and not (odd_step or odd_gap)
    if not (apart and u.strides == w.strides and u.strides[0] == size):
        return None
    line = np.lib.stride_tricks.as_strided(u, ((n_times - 1) * step + gap + n,), (size,))
    half, shape = n * n_times, (n, n_times)
    _pack(line, gap, step, n, n_times)
    turned = line[half : 2 * half].reshape(shape)
    _turn(line[:half], n, turned)
    return line[:half].reshape(shape), turned


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
def _quantise(line: Any, step: int, scale: float, missing: int, stored: Any) -> int:
    n_times, n_nodes = stored.shape
    limit = -(missing + 1.0)
    lost = 0
    for t in range(n_times):
        here, out = line[t * step : t * step + n_nodes], stored[t]
        for i in range(n_nodes):
            # Compared before the conversion, because the integer of a NaN is undefined.
            steps = np.rint(here[i] / scale)
            fits = abs(steps) <= limit
            lost += 0 if fits else 1
            out[i] = np.int32(steps) if fits else missing
    return lost


@jit()
def _pack(line: Any, first: int, step: int, n: int, n_times: int) -> None:
    """Move n values out of every `step`, from `first` on, to the front, one time after another."""
    for t in range(n_times):
        for i in range(n):
            line[t * n + i] = line[t * step + first + i]


@jit()
def _turn(line: Any, step: int, out: Any) -> None:
    n_nodes, n_times = out.shape
    for first in range(0, n_times, _TILE):
        last = min(first + _TILE, n_times)
        for i in range(n_nodes):
            for t in range(first, last):
                out[i, t] = line[t * step + i]
