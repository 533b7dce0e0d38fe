"""Sums over a window that slides along a ring: T_i = sum_{|k| <= P} y_{i+k} for all nodes i.

The window slides once around the ring, in strides of eight nodes. The changes y_{i+P} - y_{i-P-1}
are summed within a stride (`simd.SCAN`), then added to the window's sum before the stride. The cost
of a step does not depend on P. Eight nodes of one trajectory (`changes_along`) and eight
trajectories (`stride_across`) use the same additions in the same order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import (
    add_shifted,
    broadcast,
    fold,
    load,
    load_at,
    load_some,
)


class Ring(NamedTuple):
    """The ring along which the window slides: ``n`` rows from ``row`` on; ``half`` is P."""

    y: NDArray[np.float64]
    row: int
    n: int
    half: int


@jit()
def _ends(ring, i):
    # Nodes that enter and leave the window: T_i - T_{i-1} = y_{i+P} - y_{i-P-1}.
    n, ahead, behind = ring.n, i + ring.half, i - ring.half - 1
    return ahead - n if ahead >= n else ahead, behind + n if behind < 0 else behind


@jit()
def _change(zero, ring, i):
    ahead, behind = _ends(ring, i)
    return load(zero, ring.y, ring.row + ahead) - load(zero, ring.y, ring.row + behind)


@jit()
def _around(zero, ring, i):
    return load(zero, ring.y, ring.row + (i if i < ring.n else i - ring.n))


@jit()
def first_across(zero, ring):
    """Return T_{-1}. Rows are added to eight partial sums in turn, folded as in `simd.fold`."""
    s0, s1, s2, s3, s4, s5, s6, s7 = zero, zero, zero, zero, zero, zero, zero, zero
    start, end = ring.n - ring.half - 1, ring.n + ring.half
    whole = end - (2 * ring.half + 1) % 8
    for i in range(start, whole, 8):
        s0 = s0 + _around(zero, ring, i)
        s1 = s1 + _around(zero, ring, i + 1)
        s2 = s2 + _around(zero, ring, i + 2)
        s3 = s3 + _around(zero, ring, i + 3)
        s4 = s4 + _around(zero, ring, i + 4)
        s5 = s5 + _around(zero, ring, i + 5)
        s6 = s6 + _around(zero, ring, i + 6)
        s7 = s7 + _around(zero, ring, i + 7)
    i, left = whole, end - whole
    s0 = s0 + _around(zero, ring, i) if left > 0 else s0
    s1 = s1 + _around(zero, ring, i + 1) if left > 1 else s1
    s2 = s2 + _around(zero, ring, i + 2) if left > 2 else s2
    s3 = s3 + _around(zero, ring, i + 3) if left > 3 else s3
    s4 = s4 + _around(zero, ring, i + 4) if left > 4 else s4
    s5 = s5 + _around(zero, ring, i + 5) if left > 5 else s5
    s6 = s6 + _around(zero, ring, i + 6) if left > 6 else s6
    return ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))


@jit()
def _change_anywhere(zero, window, j):
    ring, i = window
    return _change(zero, ring, i + j)


@jit()
def _change_inside(zero, window, j):
    y, ahead, behind = window
    return load(zero, y, ahead + j) - load(zero, y, behind + j)


@jit(inline="always")
def _stride(zero, change, window, before, i, node, context):
    x0 = change(zero, window, 0)
    x1 = change(zero, window, 1) + x0
    node(zero, i, before + x0, context)
    node(zero, i + 1, before + x1, context)
    x2 = change(zero, window, 2)
    x3 = change(zero, window, 3) + x2
    x2, x3 = x2 + x1, x3 + x1
    node(zero, i + 2, before + x2, context)
    node(zero, i + 3, before + x3, context)
    x4 = change(zero, window, 4)
    x5 = change(zero, window, 5) + x4
    x6 = change(zero, window, 6)
    x7 = change(zero, window, 7) + x6
    x6, x7 = x6 + x5, x7 + x5
    x4, x5, x6, x7 = x4 + x3, x5 + x3, x6 + x3, x7 + x3
    node(zero, i + 4, before + x4, context)
    node(zero, i + 5, before + x5, context)
    node(zero, i + 6, before + x6, context)
    after = before + x7
    node(zero, i + 7, after, context)
    return after


@jit(inline="always")
def stride_across(zero, ring, before, i, node, context):
    """Call ``node(zero, j, T_j, context)`` for j = i ... i + 7, given T_{i-1}; returns T_{i+7}."""
    # Rows are contiguous if neither end of the window passes the end of the ring.
    ahead, behind = _ends(ring, i)
    if max(ahead, behind) + 8 <= ring.n:
        window = ring.y, ring.row + ahead, ring.row + behind
        return _stride(zero, _change_inside, window, before, i, node, context)
    return _stride(zero, _change_anywhere, (ring, i), before, i, node, context)


@jit(inline="always")
def rest_across(zero, ring, before, node, context):
    """Call ``node`` for the nodes after the last whole stride, as `stride_across` does."""
    left = ring.n % 8
    i = ring.n - left
    if left > 0:
        x0 = _change(zero, ring, i)
        node(zero, i, before + x0, context)
    if left > 1:
        x1 = _change(zero, ring, i + 1) + x0
        node(zero, i + 1, before + x1, context)
    if left > 2:
        x2 = _change(zero, ring, i + 2)
        node(zero, i + 2, before + (x2 + x1), context)
    if left > 3:
        x3 = _change(zero, ring, i + 3) + x2
        x3 = x3 + x1
        node(zero, i + 3, before + x3, context)
    if left > 4:
        x4 = _change(zero, ring, i + 4)
        node(zero, i + 4, before + (x4 + x3), context)
    if left > 5:
        x5 = _change(zero, ring, i + 5) + x4
        node(zero, i + 5, before + (x5 + x3), context)
    if left > 6:
        x6 = _change(zero, ring, i + 6) + x5
        node(zero, i + 6, before + (x6 + x3), context)


@jit()
def _load_ring(ring, i):
    # Eight neighbours from node i on, 0 <= i < 2n, across the end of the ring.
    y, row, n, _ = ring
    i = i - n if i >= n else i
    if i + 8 <= n:
        return load_at(y, row + i)
    return load_some(y, row + i, 0, n - i) + load_some(y, row + i - n, n - i, 8)


@jit()
def first_along(ring):
    """Return the sum T_{-1} of one trajectory with at least eight nodes."""
    y, row, n, half = ring
    total = broadcast(0.0)
    left, i = 2 * half + 1, n - half - 1
    while left >= 8:
        total = total + _load_ring(ring, i)
        i, left = i + 8, left - 8
        i = i - n if i >= n else i
    if left > 0:
        split = min(n - i, left)
        total = total + (load_some(y, row + i, 0, split) + load_some(y, row + i - n, split, left))
    return fold(total)


@jit()
def changes_along(ring, i):
    """Return T_i - T_{i-1}, T_{i+1} - T_{i-1}, ... T_{i+7} - T_{i-1} of one trajectory."""
    ahead, behind = _ends(ring, i)
    if max(ahead, behind) + 8 <= ring.n:
        x = load_at(ring.y, ring.row + ahead) - load_at(ring.y, ring.row + behind)
    else:
        x = _load_ring(ring, ahead) - _load_ring(ring, behind)
    return add_shifted(add_shifted(add_shifted(x, 0), 1), 2)
