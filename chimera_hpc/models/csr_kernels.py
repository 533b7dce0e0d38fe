"""Compiled products of a packed sparse matrix (`csr`) and the rows of an array (rows, lanes).

A product is one multiply-add per entry, or one addition if the entries of a row are equal, in the
order of the columns. It is written once for a number and for a vector of eight trajectories, so
that both have the same bits. Rows that a matrix shares are multiplied first, into rows of an array
for work. ``work`` is (zero, that array, its first row).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import fma, integer_at, load, real_at, store


class Matrix(NamedTuple):
    """A packed matrix in ``ints``: its rows, and the offsets of its parts (see `csr.pack`)."""

    ints: NDArray[np.int64]
    rows: int
    shared: int
    order: int
    start: int
    column: int
    value: int
    each: int
    runs: int


@jit()
def matrix_at(ints, number):
    """Return the packed matrix ``number``."""
    at = 8 * number
    rows, shared, order, start = ints[at], ints[at + 1], ints[at + 2], ints[at + 3]
    column, value, each, runs = ints[at + 4], ints[at + 5], ints[at + 6], ints[at + 7]
    return Matrix(ints, rows, shared, order, start, column, value, each, runs)


@jit()
def row_at(matrix, k):
    """Return the number of the row that is stored at place k."""
    return integer_at(matrix.ints, matrix.order + k)


@jit()
def _ends(matrix, k):
    at = matrix.start + k
    return integer_at(matrix.ints, at), integer_at(matrix.ints, at + 1)


@jit()
def _times(matrix, e, y, row, total):
    entry = load(total, y, row + integer_at(matrix.ints, matrix.column + e))
    return fma(real_at(matrix.ints, matrix.value + e), entry, total)


@jit()
def _plus(matrix, e, y, row, total):
    return total + load(total, y, row + integer_at(matrix.ints, matrix.column + e))


# A row is added to four partial sums in turn: one would wait for each addition to end.


@jit(inline="always")
def _sum_of(zero, add, matrix, begin, length, y, row):
    s0, s1, s2, s3 = zero, zero, zero, zero
    left = length % 4
    whole = begin + length - left
    for e in range(begin, whole, 4):
        s0 = add(matrix, e, y, row, s0)
        s1 = add(matrix, e + 1, y, row, s1)
        s2 = add(matrix, e + 2, y, row, s2)
        s3 = add(matrix, e + 3, y, row, s3)
    if left > 0:
        s0 = add(matrix, whole, y, row, s0)
    if left > 1:
        s1 = add(matrix, whole + 1, y, row, s1)
    if left > 2:
        s2 = add(matrix, whole + 2, y, row, s2)
    return (s0 + s1) + (s2 + s3)


@jit(inline="always")
def _sum(zero, add, matrix, k, y, row):
    begin, end = _ends(matrix, k)
    return _sum_of(zero, add, matrix, begin, end - begin, y, row)


@jit(inline="always")
def _sums(zero, add, matrix, k, y, rows):
    first, second = rows
    begin, end = _ends(matrix, k)
    a0, a1, b0, b1 = zero, zero, zero, zero
    whole = end - (end - begin) % 2
    for e in range(begin, whole, 2):
        a0, b0 = add(matrix, e, y, first, a0), add(matrix, e, y, second, b0)
        a1, b1 = add(matrix, e + 1, y, first, a1), add(matrix, e + 1, y, second, b1)
    if whole < end:
        a0, b0 = add(matrix, whole, y, first, a0), add(matrix, whole, y, second, b0)
    return a0 + a1, b0 + b1


@jit()
def _factor(matrix, k):
    return real_at(matrix.ints, matrix.each + k)


@jit()
def _diagonal(matrix, k):
    return real_at(matrix.ints, matrix.each + matrix.rows + k)


@jit()
def multiply_shared(matrix, y, row, work):
    """Multiply the shared rows with ``y[row ...]``, for `product`."""
    zero, array, at = work
    for k in range(matrix.shared):
        store(array, at + k, _sum(zero, _times, matrix, k, y, row))


@jit(inline="always")
def product(matrix, k, y, row, total, work):
    """Return ``total + sum_j M_ij y[row + j]`` for the row i that is stored at place k."""
    zero, array, at = work
    if matrix.shared > 0:
        total = total + load(total, array, at + integer_at(matrix.ints, matrix.each + k))
    elif matrix.value > 0:
        return total + _sum(zero, _times, matrix, k, y, row)
    else:
        total = fma(_factor(matrix, k), _sum(zero, _plus, matrix, k, y, row), total)
    return fma(_diagonal(matrix, k), load(total, y, row + row_at(matrix, k)), total)


# Two rows of a run, which have equal lengths, share the loop. The sum of each is that of `_sum`.


@jit(inline="always")
def _pair(zero, add, matrix, begin, length, y, row):
    a0, a1, a2, a3 = zero, zero, zero, zero
    b0, b1, b2, b3 = zero, zero, zero, zero
    left = length % 4
    whole = begin + length - left
    other = whole + length
    for e in range(begin, whole, 4):
        a0, b0 = add(matrix, e, y, row, a0), add(matrix, e + length, y, row, b0)
        a1, b1 = add(matrix, e + 1, y, row, a1), add(matrix, e + 1 + length, y, row, b1)
        a2, b2 = add(matrix, e + 2, y, row, a2), add(matrix, e + 2 + length, y, row, b2)
        a3, b3 = add(matrix, e + 3, y, row, a3), add(matrix, e + 3 + length, y, row, b3)
    if left > 0:
        a0, b0 = add(matrix, whole, y, row, a0), add(matrix, other, y, row, b0)
    if left > 1:
        a1, b1 = add(matrix, whole + 1, y, row, a1), add(matrix, other + 1, y, row, b1)
    if left > 2:
        a2, b2 = add(matrix, whole + 2, y, row, a2), add(matrix, other + 2, y, row, b2)
    return (a0 + a1) + (a2 + a3), (b0 + b1) + (b2 + b3)


@jit()
def _with_values(matrix, k, total, entries, own):
    return total + entries


@jit()
def _with_factor(matrix, k, total, entries, own):
    return fma(_diagonal(matrix, k), own, fma(_factor(matrix, k), entries, total))


@jit(inline="always")
def _end_row(close, operands, k, entries, local, context, target):
    zero, matrix, y, row = operands
    out, first = target
    i = row_at(matrix, k)
    own = load(zero, y, row + i)
    store(out, first + i, close(matrix, k, local(zero, i, context), entries, own))


@jit(inline="always")
def _add_rows(add, close, operands, local, context, target):
    zero, matrix, y, row = operands
    first = begin = 0
    for run in range(integer_at(matrix.ints, matrix.runs)):
        length = integer_at(matrix.ints, matrix.runs + 1 + 2 * run)
        end = integer_at(matrix.ints, matrix.runs + 2 + 2 * run)
        pairs = end - (end - first) % 2
        for k in range(first, pairs, 2):
            a, b = _pair(zero, add, matrix, begin, length, y, row)
            begin += 2 * length
            _end_row(close, operands, k, a, local, context, target)
            _end_row(close, operands, k + 1, b, local, context, target)
        if pairs < end:
            total = _sum_of(zero, add, matrix, begin, length, y, row)
            begin += length
            _end_row(close, operands, pairs, total, local, context, target)
        first = end


@jit(inline="always")
def add_products(matrix, y, row, local, context, target, work):
    """Write ``local(zero, i, context) + sum_j M_ij y[row + j]`` for all rows i.

    ``target`` is (out, first): row ``first + i`` of ``out`` is written. The bits are those of
    `product`.
    """
    zero = work[0]
    operands = zero, matrix, y, row
    if matrix.shared > 0:
        out, first = target
        for k in range(matrix.rows):
            i = row_at(matrix, k)
            total = product(matrix, k, y, row, local(zero, i, context), work)
            store(out, first + i, total)
    elif matrix.value > 0:
        _add_rows(_times, _with_values, operands, local, context, target)
    else:
        _add_rows(_plus, _with_factor, operands, local, context, target)


@jit()
def multiply_shared_twice(matrix, y, rows, work):
    """Multiply the shared rows with two parts of y, for `products`; needs two rows of work each."""
    zero, array, at = work
    for k in range(matrix.shared):
        a, b = _sums(zero, _times, matrix, k, y, rows)
        store(array, at + 2 * k, a)
        store(array, at + 2 * k + 1, b)


@jit(inline="always")
def products(matrix, k, y, rows, totals, work):
    """Return what `product` does for two (row, total); entries are read once."""
    a, b = totals
    zero, array, at = work
    if matrix.shared > 0:
        at = at + 2 * integer_at(matrix.ints, matrix.each + k)
        a, b = a + load(a, array, at), b + load(b, array, at + 1)
    elif matrix.value > 0:
        sum_a, sum_b = _sums(zero, _times, matrix, k, y, rows)
        return a + sum_a, b + sum_b
    else:
        sum_a, sum_b = _sums(zero, _plus, matrix, k, y, rows)
        a, b = fma(_factor(matrix, k), sum_a, a), fma(_factor(matrix, k), sum_b, b)
    own, i = _diagonal(matrix, k), row_at(matrix, k)
    return fma(own, load(a, y, rows[0] + i), a), fma(own, load(b, y, rows[1] + i), b)
