"""Series as integers: rounding, range and missing samples against the slow way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from store_tools import encode_series

from chimera_hpc.measures.series import by_node, quantise, restore, round_to, turn_in_place
from chimera_hpc.store.schema import MISSING, SCALE


def quantised(rows):
    out = np.full(rows.shape[::-1], 12345, dtype=np.int16)
    lost = quantise(rows, SCALE, MISSING, out)
    assert lost == np.count_nonzero(out == MISSING)
    back = np.empty(rows.shape)
    restore(out, SCALE, back)
    np.testing.assert_array_equal(back.T, out * SCALE)
    return out


def naive_steps(value):
    """One sample, by Python's own rounding (half to even)."""
    if not abs(value) < 4.0 or abs(round(value / 1e-4)) > 32767:
        return -32768
    return round(value / 1e-4)


@pytest.mark.parametrize(
    ("value", "steps"),
    [
        (0.0, 0),
        (-0.0, 0),
        (1.0, 10000),
        (-1.23456, -12346),
        (0.00004, 0),
        (0.00006, 1),
        (0.5e-4, 0),  # halves go to the even neighbour
        (2.5e-4, 2),
        (-2.5e-4, -2),
        (3.2767, 32767),
        (-3.2767, -32767),
        (3.27674, 32767),
        (3.27676, MISSING),
        (-3.27676, MISSING),
        (-3.2768, MISSING),  # the code of a missing sample is no value
        (6.5536, MISSING),  # would come round to 0
        (-6.5537, MISSING),
        (429496.7297, MISSING),
        (1e15, MISSING),
        (1e300, MISSING),
        (np.inf, MISSING),
        (-np.inf, MISSING),
        (np.nan, MISSING),
    ],
)
def test_one_sample(value, steps):
    assert quantised(np.array([[value]]))[0, 0] == steps
    assert naive_steps(value) == steps
    assert encode_series(np.array([value]), np.int16)[0] == steps


@given(
    hnp.arrays(
        np.float64,
        st.tuples(st.integers(1, 5), st.integers(1, 200)),
        elements=st.one_of(st.floats(-4, 4), st.floats()),
    )
)
def test_series_equals_the_slow_one_sample_by_sample(rows):
    expected = [[naive_steps(value) for value in column] for column in rows.T]
    np.testing.assert_array_equal(quantised(rows), expected)


def test_a_row_that_is_not_contiguous_is_read_where_it_is():
    wide = np.random.default_rng(0).uniform(-2, 2, (3, 400))
    np.testing.assert_array_equal(quantised(wide[:, ::2]), encode_series(wide[:, ::2].T, np.int16))


@given(hnp.arrays(np.float64, (2, 60), elements=st.floats(-4, 4)))
def test_rounded_twice_is_rounded_once(rows):
    rounded = np.empty(rows.shape)
    round_to(rows, SCALE, rounded)
    np.testing.assert_array_equal(rounded, np.rint(rows / SCALE) * SCALE)
    again = np.empty(rows.shape)
    round_to(rounded, SCALE, again)
    np.testing.assert_array_equal(again, rounded)
    np.testing.assert_array_equal(quantised(rounded), quantised(rows))


SAMPLES = np.random.default_rng(1).uniform(-2, 2, (130, 12))


@pytest.mark.parametrize(
    "rows",
    [
        SAMPLES.T,
        SAMPLES[:, 3:9].T,  # as the integrator leaves u, or w
        SAMPLES[::2, :5].T,
        SAMPLES[:1].T,
        SAMPLES[:, ::2].T,  # not side by side in memory
        SAMPLES[:, ::-1].T,
        SAMPLES[::-1].T,
        SAMPLES.T.copy(),
        np.broadcast_to(SAMPLES[0], (130, 12)).T,
    ],
)
def test_rows_of_any_layout_are_turned_and_quantised_alike(rows):
    turned = by_node(rows, np.empty(rows.shape))
    assert turned.flags.c_contiguous
    np.testing.assert_array_equal(turned, rows)
    np.testing.assert_array_equal(quantised(rows), encode_series(rows.T, np.int16))


@pytest.mark.parametrize(
    ("width", "first", "second", "n"),
    [(8, 0, 4, 4), (8, 0, 3, 3), (16, 1, 12, 4), (24, 0, 16, 8), (8, 6, 7, 1)],
)
@pytest.mark.parametrize("n_times", [2, 63, 64, 200])
def test_two_signals_are_turned_within_their_memory(width, first, second, n, n_times):
    samples = np.random.default_rng(2).random((n_times + 2, width))
    before = samples.copy()
    u, w = (samples[1:-1, at : at + n].T for at in (first, second))
    expected = w.copy()
    room, turned = turn_in_place(u, w)
    for rows in (room, turned):
        assert rows.shape == (n, n_times)
        assert rows.flags.c_contiguous
        assert rows.flags.writeable
        assert np.shares_memory(rows, samples)
    np.testing.assert_array_equal(turned, expected)
    room[:] = -1.0
    np.testing.assert_array_equal(turned, expected)
    np.testing.assert_array_equal(samples[[0, -1]], before[[0, -1]])


@pytest.mark.parametrize("samples", [SAMPLES[:, :5], SAMPLES[:, :1], SAMPLES[:1]])
def test_two_arrays_are_turned_within_their_memory(samples):
    u, w = np.cos(samples.T), np.sin(samples.T)
    expected = w.copy()
    room, turned = turn_in_place(u, w)
    room[:] = -1.0
    np.testing.assert_array_equal(turned, expected)
    assert np.shares_memory(turned, u)
    assert np.shares_memory(room, w)
    assert turned.flags.c_contiguous
    assert room.flags.c_contiguous


OTHERS, ALONE = SAMPLES.copy(), np.cos(SAMPLES[:, :4].T)
SAME_TIMES = np.broadcast_to(SAMPLES[0], (130, 12)).T


@pytest.mark.parametrize(
    ("u", "w"),
    [
        (SAMPLES[:, :4].T, SAMPLES[:, :4].T),  # the same
        (SAMPLES[:, 4:8].T, SAMPLES[:, :4].T),  # the other way round
        (SAMPLES[:, :4].T, SAMPLES[:, 2:6].T),  # they overlap
        (SAMPLES[:, :4].T, SAMPLES[1:, 4:8].T),
        (SAMPLES[:1, :4].T, SAMPLES[:1, 4:8].T),
        (SAMPLES[:, :4].T, OTHERS[:, 4:8].T),
        (ALONE, ALONE),
        (ALONE.copy(), ALONE.copy()),
        (ALONE, ALONE[:, ::-1]),
        (SAME_TIMES[:4], SAME_TIMES[4:8]),
    ],
)
def test_signals_that_lie_in_another_way_are_left_as_they_are(u, w):
    before = u.copy(), w.copy(), SAMPLES.copy()
    assert turn_in_place(u, w) is None
    for array, copy in zip((u, w, SAMPLES), before, strict=True):
        np.testing.assert_array_equal(array, copy)
