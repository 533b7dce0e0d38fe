"""SIMD vectors: every operation does in each lane what it does to a number, to the last bit."""

from __future__ import annotations

import operator

import naive
import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernel_tools import compiled

from chimera_hpc.integrate.scratch import aligned
from chimera_hpc.integrate.simd import (
    LANES,
    across,
    add_shifted,
    broadcast,
    fma,
    fold,
    larger,
    last_of,
    load,
    load_at,
    load_some,
    magnitude,
    store,
    store_at,
    store_some,
    stream_at,
    transposed,
)

# Numbers with which arithmetic goes wrong first, and some ordinary ones.
SPECIAL = [0.0, -0.0, 1.0, -1.5, np.inf, -np.inf, np.nan, 5e-324, 1e308, -1e-308, 1 / 3, -7e22]


def pairs():
    """Arrays (rows, LANES) with every pair of special numbers in some lane."""
    a, b = np.meshgrid(SPECIAL, SPECIAL)
    return a.reshape(-1, LANES).copy(), b.reshape(-1, LANES).copy()


def apply_both(operation):
    """The operation on all pairs, as vectors and number by number."""

    @numba.njit
    def work(like, a, b, out):
        for row in range(a.shape[0]):
            store(out, row, operation(load(like, a, row), load(like, b, row)))

    @numba.njit
    def vectors(a, b, out):
        work(broadcast(0.0), a, b, out)

    a, b = pairs()
    vector, single = np.empty_like(a), np.empty_like(a)
    vectors(a, b, vector)
    columns = [x.reshape(-1, 1) for x in (a, b, single)]
    work(0.0, *columns)
    return a, b, vector, single


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
    a, b, vector, single = apply_both(numba.njit(error_model="numpy")(lambda a, b: operation(a, b)))
    with np.errstate(all="ignore"):
        truth = expected(a, b)
    for got in (vector, single):
        np.testing.assert_array_equal(got, truth)
        signs = ~np.isnan(truth)
        np.testing.assert_array_equal(np.signbit(got[signs]), np.signbit(truth[signs]))


def test_larger_takes_the_second_where_either_is_nan():
    a, b, vector, _ = apply_both(numba.njit(lambda a, b: larger(a, b)))
    either = np.isnan(a) | np.isnan(b)
    np.testing.assert_array_equal(vector[either], b[either])


def test_magnitude_of_vectors_and_numbers():
    a, _, vector, single = apply_both(numba.njit(lambda a, b: magnitude(a)))
    for got in (vector, single):
        np.testing.assert_array_equal(got, np.abs(a))
        assert not np.signbit(got[~np.isnan(a)]).any()


@compiled
def mixed(y, dy, lane_params, int_params):
    # A vector and a number, on either side.
    like = broadcast(0.0)
    x = load(like, y, 0)
    store(dy, 0, 2.0 + x)
    store(dy, 1, x + 2.0)
    store(dy, 2, 2.0 - x)
    store(dy, 3, x - 2.0)
    store(dy, 4, 2.0 * x)
    store(dy, 5, x * 2.0)
    store(dy, 6, 2.0 / x)
    store(dy, 7, x / 2.0)


def test_a_number_meets_every_lane_of_a_vector():
    x = np.linspace(-3.0, 5.0, LANES)
    out = np.empty((8, LANES))
    mixed(x[None, :].copy(), out, np.zeros((1, LANES)), np.zeros(1, dtype=np.int64))
    expected = [2.0 + x, x + 2.0, 2.0 - x, x - 2.0, 2.0 * x, x * 2.0, 2.0 / x, x / 2.0]
    np.testing.assert_array_equal(out, expected)


@compiled
def fused(y, dy, lane_params, int_params):
    # Vectors and numbers in every place.
    like, number = broadcast(0.0), lane_params[0, 0]
    a, b, c = load(like, y, 0), load(like, y, 1), load(like, y, 2)
    store(dy, 0, fma(a, b, c))
    store(dy, 1, fma(number, b, c))
    store(dy, 2, fma(a, number, c))
    store(dy, 3, fma(a, b, number))
    store(dy, 4, fma(number, number, c))
    for lane in range(LANES):
        dy[5, lane] = fma(y[0, lane], y[1, lane], y[2, lane])


NUMBERS = st.floats(-1e100, 1e100).filter(lambda x: x == 0.0 or abs(x) > 1e-100)


@given(
    st.lists(NUMBERS, min_size=2 * LANES, max_size=2 * LANES),
    st.lists(st.floats(-(2.0**-52), 2.0**-52), min_size=LANES, max_size=LANES),
    NUMBERS,
)
def test_fma_rounds_once(factors, rest, number):
    a, b = np.array(factors).reshape(2, LANES)
    # Near -a b, where two roundings leave nothing of the product's lower half.
    c = -a * b * (1.0 + np.array(rest))
    out = np.empty((6, LANES))
    fused(np.stack([a, b, c]), out, np.full((1, LANES), number), np.zeros(1, dtype=np.int64))
    np.testing.assert_array_equal(out[0], naive.fma(a, b, c))
    np.testing.assert_array_equal(out[1], naive.fma(number, b, c))
    np.testing.assert_array_equal(out[2], naive.fma(a, number, c))
    np.testing.assert_array_equal(out[3], naive.fma(a, b, number))
    np.testing.assert_array_equal(out[4], naive.fma(number, number, c))
    np.testing.assert_array_equal(out[5], out[0])


def test_fma_of_what_is_not_finite():
    y = np.zeros((3, LANES))
    y[:, :5] = np.array(
        [[np.inf, 1, 2], [np.inf, 0, 1], [1, 2, -np.inf], [np.nan, 1, 1], [9, 9, 9]]
    ).T
    out = np.empty((6, LANES))
    fused(y, out, np.zeros((1, LANES)), np.zeros(1, dtype=np.int64))
    for row in (0, 5):
        np.testing.assert_array_equal(out[row, :5], [np.inf, np.nan, -np.inf, np.nan, 90.0])


def test_rows_are_read_and_written_where_they_are():
    @numba.njit
    def swap(a):
        like = broadcast(0.0)
        first, last = load(like, a, 0), load(like, a, a.shape[0] - 1)
        store(a, 0, last)
        store(a, a.shape[0] - 1, first)

    # Rows of vectors need not begin on its size in memory.
    raw = np.arange(5.0 * LANES + 1.0)[1:]
    a = raw.reshape(5, LANES)
    expected = a[[4, 1, 2, 3, 0]].copy()
    swap(a)
    np.testing.assert_array_equal(a, expected)


@numba.njit
def neighbours(work, array, offset, low, high, out):
    whole = load_at(array, offset)
    store_at(out, 0, whole)
    store_at(out, 8, load_some(array, offset, low, high))
    store_some(out, 16, whole, high)
    store_at(out, 24, add_shifted(add_shifted(add_shifted(whole, 0), 1), 2))
    store_at(out, 32, across(work, array, 2))
    out[40, 0] = fold(whole)
    out[41, 0] = last_of(whole)


@pytest.mark.parametrize(("low", "high"), [(0, 0), (0, 8), (0, 3), (5, 8), (2, 6)])
def test_vectors_of_neighbouring_rows(low, high):
    array = np.random.default_rng(0).normal(size=(40, 1))
    out = np.full((48, 1), 7.0)
    neighbours(0.0, array, 11, low, high, out)
    rows = array[11:19, 0]
    inside = (np.arange(8) >= low) & (np.arange(8) < high)
    assert out[:8, 0].tolist() == rows.tolist()
    assert out[8:16, 0].tolist() == np.where(inside, rows, 0.0).tolist()
    assert np.signbit(out[8:16, 0][~inside]).all()
    assert out[16:24, 0].tolist() == [*rows[:high], *[7.0] * (8 - high)]
    np.testing.assert_allclose(out[24:32, 0], np.cumsum(rows), rtol=1e-14, atol=1e-15)
    assert (out[32:40, 0] == array[2, 0]).all()
    assert out[40, 0] == pytest.approx(rows.sum(), rel=1e-14)
    assert out[41, 0] == rows[7]


def test_eight_vectors_are_transposed():
    @numba.njit
    def turn(a, out):
        like = broadcast(0.0)
        p0, p1, p2, p3 = load(like, a, 0), load(like, a, 1), load(like, a, 2), load(like, a, 3)
        p4, p5, p6, p7 = load(like, a, 4), load(like, a, 5), load(like, a, 6), load(like, a, 7)
        q0, q1, q2, q3, q4, q5, q6, q7 = transposed((p0, p1, p2, p3, p4, p5, p6, p7))
        stream_at(out, 0, q0)
        stream_at(out, 8, q1)
        stream_at(out, 16, q2)
        stream_at(out, 24, q3)
        stream_at(out, 32, q4)
        stream_at(out, 40, q5)
        stream_at(out, 48, q6)
        stream_at(out, 56, q7)

    a, out = np.arange(64.0).reshape(8, 8), aligned(8, 8)
    turn(a, out)
    np.testing.assert_array_equal(out, a.T)


def test_what_is_not_loaded_is_not_touched():
    # A ring's end: the places before the array's first and behind its last number are masked out.
    array = np.arange(8.0).reshape(8, 1)
    out = np.zeros((48, 1))

    @numba.njit
    def ends(array, out):
        store_at(out, 0, load_some(array, 5, 0, 3) + load_some(array, -3, 3, 8))

    ends(array, out)
    assert out[:8, 0].tolist() == [5.0, 6.0, 7.0, 0.0, 1.0, 2.0, 3.0, 4.0]
