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


@jit()
def matrix_at(ints, number):
    """Return the packed matrix ``number``."""
    at = 7 * number
    rows, shared, order, start = ints[at], ints[at + 1], ints[at + 2], ints[at + 3]
    return Matrix(ints, rows, shared, order, start, ints[at + 4], ints[at + 5], ints[at + 6])


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
def _sum(zero, add, matrix, k, y, row):
    begin, end = _ends(matrix, k)
    s0, s1, s2, s3 = zero, zero, zero, zero
    whole = end - (end - begin) % 4
    for e in range(begin, whole, 4):
        s0 = add(matrix, e, y, row, s0)
        s1 = add(matrix, e + 1, y, row, s1)
        s2 = add(matrix, e + 2, y, row, s2)
        s3 = add(matrix, e + 3, y, row, s3)
    if whole < end:
        s0 = add(matrix, whole, y, row, s0)
    if whole + 1 < end:
        s1 = add(matrix, whole + 1, y, row, s1)
    if whole + 2 < end:
        s2 = add(matrix, whole + 2, y, row, s2)
    return (s0 + s1) + (s2 + s3)


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
