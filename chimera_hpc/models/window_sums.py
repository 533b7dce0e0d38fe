"""Sums over a window that slides along a ring: T_i = sum_{|k| <= P} y_{i+k} for all nodes i.

The window slides once, in strides of eight nodes: the changes y_{i+P} - y_{i-P-1} add up within a
stride (`simd.SCAN`), then to the window's sum before it. A step costs the same for every P, and
eight nodes of one trajectory can go together (`changes_along`) as eight trajectories do
(`stride_across`), with the same additions in the same order.
"""

from __future__ import annotations

from typing import Any

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import (
    add_shifted,
    fold,
    load,
    load_at,
    load_some,
    splat,
)


@jit()
def _ends(n: Any, half: Any, i: Any) -> Any:
    # Nodes that come and go: T_i - T_{i-1} = y_{i+P} - y_{i-P-1}.
    ahead, behind = i + half, i - half - 1
    return ahead - n if ahead >= n else ahead, behind + n if behind < 0 else behind


@jit()
def _change(zero: Any, y: Any, row: Any, n: Any, half: Any, i: Any) -> Any:
    ahead, behind = _ends(n, half, i)
    return load(zero, y, row + ahead) - load(zero, y, row + behind)


@jit()
def _around(zero: Any, y: Any, row: Any, n: Any, i: Any) -> Any:
    return load(zero, y, row + (i if i < n else i - n))


@jit()
def first_across(zero: Any, y: Any, row: Any, n: Any, half: Any) -> Any:
    """Give the sum T_{-1}, the rows going to eight sums in turn, folded as in `simd.fold`."""
    s0, s1, s2, s3, s4, s5, s6, s7 = zero, zero, zero, zero, zero, zero, zero, zero
    start, end = n - half - 1, n + half
    whole = end - (2 * half + 1) % 8
    for i in range(start, whole, 8):
        s0 = s0 + _around(zero, y, row, n, i)
        s1 = s1 + _around(zero, y, row, n, i + 1)
        s2 = s2 + _around(zero, y, row, n, i + 2)
        s3 = s3 + _around(zero, y, row, n, i + 3)
        s4 = s4 + _around(zero, y, row, n, i + 4)
        s5 = s5 + _around(zero, y, row, n, i + 5)
        s6 = s6 + _around(zero, y, row, n, i + 6)
        s7 = s7 + _around(zero, y, row, n, i + 7)
    i, left = whole, end - whole
    s0 = s0 + _around(zero, y, row, n, i) if left > 0 else s0
    s1 = s1 + _around(zero, y, row, n, i + 1) if left > 1 else s1
    s2 = s2 + _around(zero, y, row, n, i + 2) if left > 2 else s2
    s3 = s3 + _around(zero, y, row, n, i + 3) if left > 3 else s3
    s4 = s4 + _around(zero, y, row, n, i + 4) if left > 4 else s4
    s5 = s5 + _around(zero, y, row, n, i + 5) if left > 5 else s5
    s6 = s6 + _around(zero, y, row, n, i + 6) if left > 6 else s6
    return ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))


@jit()
def _change_anywhere(zero: Any, y: Any, window: Any, j: Any) -> Any:
    row, n, half, i = window
    return _change(zero, y, row, n, half, i + j)


@jit()
def _change_inside(zero: Any, y: Any, window: Any, j: Any) -> Any:
    ahead, behind = window
    return load(zero, y, ahead + j) - load(zero, y, behind + j)


@jit(inline="always")
def _stride(
    zero: Any, y: Any, change: Any, window: Any, before: Any, i: Any, node: Any, context: Any
) -> Any:
    x0 = change(zero, y, window, 0)
    x1 = change(zero, y, window, 1) + x0
    node(zero, i, before + x0, context)
    node(zero, i + 1, before + x1, context)
    x2 = change(zero, y, window, 2)
    x3 = change(zero, y, window, 3) + x2
    x2, x3 = x2 + x1, x3 + x1
    node(zero, i + 2, before + x2, context)
    node(zero, i + 3, before + x3, context)
    x4 = change(zero, y, window, 4)
    x5 = change(zero, y, window, 5) + x4
    x6 = change(zero, y, window, 6)
    x7 = change(zero, y, window, 7) + x6
    x6, x7 = x6 + x5, x7 + x5
    x4, x5, x6, x7 = x4 + x3, x5 + x3, x6 + x3, x7 + x3
    node(zero, i + 4, before + x4, context)
    node(zero, i + 5, before + x5, context)
    node(zero, i + 6, before + x6, context)
    after = before + x7
    node(zero, i + 7, after, context)
    return after


@jit(inline="always")
def stride_across(
    zero: Any, y: Any, row: Any, n: Any, half: Any, before: Any, i: Any, node: Any, context: Any
) -> Any:
    """Call ``node(zero, j, T_j, context)`` for j = i ... i + 7, given T_{i-1}; returns T_{i+7}."""
    # Where neither end of the window passes the ring's end, rows follow each other.
    ahead, behind = _ends(n, half, i)
    if max(ahead, behind) + 8 <= n:
        window = row + ahead, row + behind
        return _stride(zero, y, _change_inside, window, before, i, node, context)
    return _stride(zero, y, _change_anywhere, (row, n, half, i), before, i, node, context)


@jit(inline="always")
def rest_across(
    zero: Any, y: Any, row: Any, n: Any, half: Any, before: Any, node: Any, context: Any
) -> None:
    """Call ``node`` for the nodes after the last whole stride, as `stride_across` does."""
    left = n % 8
    i = n - left
    if left > 0:
        x0 = _change(zero, y, row, n, half, i)
        node(zero, i, before + x0, context)
    if left > 1:
        x1 = _change(zero, y, row, n, half, i + 1) + x0
        node(zero, i + 1, before + x1, context)
    if left > 2:
        x2 = _change(zero, y, row, n, half, i + 2)
        node(zero, i + 2, before + (x2 + x1), context)
    if left > 3:
        x3 = _change(zero, y, row, n, half, i + 3) + x2
        x3 = x3 + x1
        node(zero, i + 3, before + x3, context)
    if left > 4:
        x4 = _change(zero, y, row, n, half, i + 4)
        node(zero, i + 4, before + (x4 + x3), context)
    if left > 5:
        x5 = _change(zero, y, row, n, half, i + 5) + x4
        node(zero, i + 5, before + (x5 + x3), context)
    if left > 6:
        x6 = _change(zero, y, row, n, half, i + 6) + x5
        node(zero, i + 6, before + (x6 + x3), context)


@jit()
def _load_ring(y: Any, row: Any, n: Any, i: Any) -> Any:
    # Eight neighbours from node i on, 0 <= i < 2n, over the end of the ring.
    i = i - n if i >= n else i
    if i + 8 <= n:
        return load_at(y, row + i)
    return load_some(y, row + i, 0, n - i) + load_some(y, row + i - n, n - i, 8)


@jit()
def first_along(y: Any, row: Any, n: Any, half: Any) -> Any:
    """Give the sum T_{-1} of one trajectory with at least eight nodes."""
    total = splat(0.0)
    left, i = 2 * half + 1, n - half - 1
    while left >= 8:
        total = total + _load_ring(y, row, n, i)
        i, left = i + 8, left - 8
        i = i - n if i >= n else i
    if left > 0:
        split = min(n - i, left)
        total = total + (load_some(y, row + i, 0, split) + load_some(y, row + i - n, split, left))
    return fold(total)


@jit()
def changes_along(y: Any, row: Any, n: Any, half: Any, i: Any) -> Any:
    """Give T_i - T_{i-1}, T_{i+1} - T_{i-1}, ... T_{i+7} - T_{i-1} of one trajectory."""
    ahead, behind = _ends(n, half, i)
    if max(ahead, behind) + 8 <= n:
        x = load_at(y, row + ahead) - load_at(y, row + behind)
    else:
        x = _load_ring(y, row, n, ahead) - _load_ring(y, row, n, behind)
    return add_shifted(add_shifted(add_shifted(x, 0), 1), 2)
