"""Packs: every operation does in each lane what it does to a number, to the last bit."""

from __future__ import annotations

import operator

import numba
import numpy as np
import pytest
from kernel_tools import compiled

from chimera_hpc.integrate.simd import LANES, larger, load, magnitude, splat, store

# Numbers with which arithmetic goes wrong first, and some ordinary ones.
SPECIAL = [0.0, -0.0, 1.0, -1.5, np.inf, -np.inf, np.nan, 5e-324, 1e308, -1e-308, 1 / 3, -7e22]


def pairs():
    """Arrays (rows, LANES) with every pair of special numbers in some lane."""
    a, b = np.meshgrid(SPECIAL, SPECIAL)
    return a.reshape(-1, LANES).copy(), b.reshape(-1, LANES).copy()


def apply_both(operation):
    """The operation on all pairs, as packs and number by number."""

    @numba.njit
    def work(like, a, b, out):
        for row in range(a.shape[0]):
            store(out, row, operation(load(like, a, row), load(like, b, row)))

    @numba.njit
    def packed(a, b, out):
        work(splat(0.0), a, b, out)

    a, b = pairs()
    pack, single = np.empty_like(a), np.empty_like(a)
    packed(a, b, pack)
    columns = [x.reshape(-1, 1) for x in (a, b, single)]
    work(0.0, *columns)
    return a, b, pack, single


@pytest.mark.parametrize(
    ("operation", "expected"),
    [
        (operator.add, np.add),
        (operator.sub, np.subtract),
        (operator.mul, np.multiply),
        (operator.truediv, np.divide),
        (larger, lambda a, b: np.where(a > b, a, b)),
    ],
)
def test_binary_operation(operation, expected):
    a, b, pack, single = apply_both(numba.njit(error_model="numpy")(lambda a, b: operation(a, b)))
    with np.errstate(all="ignore"):
        truth = expected(a, b)
    for got in (pack, single):
        np.testing.assert_array_equal(got, truth)
        signs = ~np.isnan(truth)
        np.testing.assert_array_equal(np.signbit(got[signs]), np.signbit(truth[signs]))


def test_larger_takes_the_second_where_either_is_nan():
    a, b, pack, _ = apply_both(numba.njit(lambda a, b: larger(a, b)))
    either = np.isnan(a) | np.isnan(b)
    np.testing.assert_array_equal(pack[either], b[either])


def test_magnitude_of_packs_and_numbers():
    a, _, pack, single = apply_both(numba.njit(lambda a, b: magnitude(a)))
    for got in (pack, single):
        np.testing.assert_array_equal(got, np.abs(a))
        assert not np.signbit(got[~np.isnan(a)]).any()


@compiled
def mixed(y, dy, lane_params, int_params):
    # A pack and a number, on either side.
    like = splat(0.0)
    x = load(like, y, 0)
    store(dy, 0, 2.0 + x)
    store(dy, 1, x + 2.0)
    store(dy, 2, 2.0 - x)
    store(dy, 3, x - 2.0)
    store(dy, 4, 2.0 * x)
    store(dy, 5, x * 2.0)
    store(dy, 6, 2.0 / x)
    store(dy, 7, x / 2.0)


def test_a_number_meets_every_lane_of_a_pack():
    x = np.linspace(-3.0, 5.0, LANES)
    out = np.empty((8, LANES))
    mixed(x[None, :].copy(), out, np.zeros((1, LANES)), np.zeros(1, dtype=np.int64))
    expected = [2.0 + x, x + 2.0, 2.0 - x, x - 2.0, 2.0 * x, x * 2.0, 2.0 / x, x / 2.0]
    np.testing.assert_array_equal(out, expected)


def test_rows_are_read_and_written_where_they_are():
    @numba.njit
    def swap(a):
        like = splat(0.0)
        first, last = load(like, a, 0), load(like, a, a.shape[0] - 1)
        store(a, 0, last)
        store(a, a.shape[0] - 1, first)

    # Rows of a pack need not begin on its size in memory.
    raw = np.arange(5.0 * LANES + 1.0)[1:]
    a = raw.reshape(5, LANES)
    expected = a[[4, 1, 2, 3, 0]].copy()
    swap(a)
    np.testing.assert_array_equal(a, expected)
