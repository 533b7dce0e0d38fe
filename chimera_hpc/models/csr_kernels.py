"""Compiled products of a packed sparse matrix (`csr`) and the rows of an array (rows, lanes).

A product is one multiply-add per entry, in the order of the columns. It is written once for a
number and for a vector of eight trajectories, so that both have the same bits. Rows that a matrix
shares are multiplied first, into rows of ``work``.
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
    start: int
    column: int
    value: int
    label: int


@jit()
def matrix_at(ints, number):
    """Return the packed matrix ``number``."""
    at = 6 * number
    return Matrix(
        ints, ints[at], ints[at + 1], ints[at + 2], ints[at + 3], ints[at + 4], ints[at + 5]
    )


@jit()
def _sum(matrix, i, y, row, total):
    ints = matrix.ints
    begin, end = integer_at(ints, matrix.start + i), integer_at(ints, matrix.start + i + 1)
    for e in range(begin, end):
        entry = load(total, y, row + integer_at(ints, matrix.column + e))
        total = fma(real_at(ints, matrix.value + e), entry, total)
    return total


@jit()
def _sums(matrix, i, y, rows, totals):
    ints = matrix.ints
    first, second = rows
    a, b = totals
    begin, end = integer_at(ints, matrix.start + i), integer_at(ints, matrix.start + i + 1)
    for e in range(begin, end):
        j = integer_at(ints, matrix.column + e)
        value = real_at(ints, matrix.value + e)
        a = fma(value, load(a, y, first + j), a)
        b = fma(value, load(b, y, second + j), b)
    return a, b


@jit()
def multiply_shared(zero, matrix, y, row, work):
    """Multiply the shared rows with ``y[row ...]``, for `product`, into ``work`` (array, row)."""
    array, at = work
    for i in range(matrix.shared):
        store(array, at + i, _sum(matrix, i, y, row, zero))


@jit()
def product(matrix, i, y, row, total, work):
    """Return ``total + sum_j M_ij y[row + j]``."""
    if matrix.shared == 0:
        return _sum(matrix, i, y, row, total)
    array, at = work
    ints = matrix.ints
    total = total + load(total, array, at + integer_at(ints, matrix.label + i))
    own = real_at(ints, matrix.label + matrix.rows + i)
    return fma(own, load(total, y, row + i), total)


@jit()
def multiply_shared_twice(zero, matrix, y, rows, work):
    """Multiply the shared rows with two parts of y, for `products`; needs two rows of work each."""
    array, at = work
    for i in range(matrix.shared):
        a, b = _sums(matrix, i, y, rows, (zero, zero))
        store(array, at + 2 * i, a)
        store(array, at + 2 * i + 1, b)


@jit()
def products(matrix, i, y, rows, totals, work):
    """Return ``total + sum_j M_ij y[row + j]`` for two (row, total); entries are read once."""
    if matrix.shared == 0:
        return _sums(matrix, i, y, rows, totals)
    array, at = work
    ints = matrix.ints
    at = at + 2 * integer_at(ints, matrix.label + i)
    own = real_at(ints, matrix.label + matrix.rows + i)
    a, b = totals[0] + load(totals[0], array, at), totals[1] + load(totals[1], array, at + 1)
    first, second = rows
    return fma(own, load(a, y, first + i), a), fma(own, load(b, y, second + i), b)
