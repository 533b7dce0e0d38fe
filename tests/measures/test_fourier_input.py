"""Bad input to the Fourier method: one line that says what, where and what is allowed."""

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.fourier import fourier_features, measure_signals

T = np.arange(2001) * 0.01
U = np.cos(4 * np.pi * T[:, None] + np.arange(3))


def broken(array, index, value):
    copy = array.copy()
    copy[index] = value
    return copy


@pytest.mark.parametrize(
    ("t", "u", "options", "message"),
    [
        (T, U, {"n_overlap": 10}, r"n_overlap must be in 0 \.\. n_peaks - 1 = 9, not 10"),
        (T, U, {"n_overlap": -1}, "n_overlap must be in"),
        (T, U, {"n_peaks": 2, "n_overlap": 0}, "n_peaks must be at least 3, not 2"),
        (T, U, {"n_peaks": 9.5}, "n_peaks must be a whole number, not 9.5"),
        (T, U, {"reference_node": 3}, r"reference_node must be in 0 \.\. 2, not 3"),
        (T, U, {"reference_node": -1}, "reference_node must be in"),
        (
            T,
            U,
            {"window_reference": "moon"},
            "window_reference must be one of ring, own, not 'moon'",
        ),
        (T, U, {"phase_mean": "mean"}, "phase_mean must be one of circular, arithmetic"),
        (T, U, {"refine": "no"}, "refine must be one of parabola, sine-fit"),
        (T, U, {"time_origin": "0"}, "time_origin must be one of window, recording, absolute"),
        (T, U, {"steady_threshold": -1.0}, "steady_threshold must be a finite number >= 0"),
        (T, U, {"steady_threshold": float("nan")}, "steady_threshold must be"),
        (
            T,
            U,
            {"steady_threshold": None},
            "steady_threshold must be a finite number >= 0, not None",
        ),
        (T, U, {"prominence": "0.1"}, "prominence must be a finite number >= 0, not '0.1'"),
        (T[:-1], U, {}, r"t must have shape \(2001,\), one time a row of u, not \(2000,\)"),
        (T[:, None], U, {}, "t must have shape"),
        (T, U[:, 0], {}, r"u must have shape \(times, nodes\), not \(2001,\)"),
        (T, U[:, :0], {}, "u must have shape"),
        (T, U.T, {}, r"t must have shape .*; u is \(3, 2001\): are its axes swapped\? pass u\.T"),
        (T[:2], U[:2], {}, "at least 3 times, not 2"),
        (T[::-1], U, {}, "t must be finite and rise"),
        (broken(T, -1, np.inf), U, {}, "t must be finite and rise"),
        (broken(T, 700, np.nan), U, {}, "t must be uniform"),
        (broken(T, 700, 7.0002), U, {}, r"uniform: a time is 0\.02 steps off, allowed is 0\.01"),
        (T**1.01, U, {}, "t must be uniform"),
        (T, broken(U, (5, 1), np.nan), {}, "u must be finite, its squares too: node 1"),
        (T, broken(U, (5, 2), np.inf), {}, "u must be finite, its squares too: node 2"),
        (T, broken(U, (5, 2), 1e200), {}, "u must be finite, its squares too: node 2"),
        (T, [["x"] * 3] * 2001, {}, "u must be an array of real numbers"),
        (T, [[1.0], [2.0, 3.0]], {}, "u must be an array of real numbers"),
        (T, U + 0j, {}, "u must be an array of real numbers"),
        (T + 0j, U, {}, "t must be an array of real numbers"),
        (T, np.ma.masked_greater(U, 0.9), {}, "u holds masked values"),
        (np.ma.masked_less(T, 1.0), U, {}, "t holds masked values"),
    ],
)
def test_bad_input_is_named(t, u, options, message):
    with pytest.raises(BadInput, match=message) as caught:
        fourier_features(t, u, **options)
    assert "\n" not in str(caught.value)


def test_times_off_by_less_than_a_hundredth_of_a_step_are_uniform():
    rounded = T + 0.4e-4 * np.random.default_rng(0).uniform(-1, 1, T.size)
    assert fourier_features(rounded, U).n_windows > 0


def test_masked_array_without_a_masked_value_is_an_array():
    found = fourier_features(T, np.ma.masked_greater(U, 2.0))
    assert found.as_array().tobytes() == fourier_features(T, U).as_array().tobytes()


@pytest.mark.parametrize(
    ("u", "options", "message"),
    [
        (np.column_stack([U, 0 * T]), {}, "column 3 of u never changes"),
        (np.column_stack([U, T]), {}, "column 3 of u rises or falls throughout"),
        (1e-6 * U, {}, "steady: .* which has the unit of u; .* pass steady_threshold=7e-09"),
        (
            U,
            {"prominence": 9.0},
            "column 0, 1, 2 of u has fewer than n_peaks = 10 .* the unit of u",
        ),
        (0.03 * U, {"preset": "paper-printed"}, "has fewer .* maxima of prominence = 0.1, which"),
    ],
)
def test_signals_that_look_like_none_are_named(u, options, message):
    with pytest.warns(UserWarning, match=message) as said:
        fourier_features(T, u, **options)
    assert [str(line.message).partition(":")[0] for line in said] == ["fourier_features"]
    assert said[0].filename == __file__


def test_axes_that_seem_to_be_swapped_are_named():
    t = np.arange(8) * 0.01
    with pytest.warns(UserWarning, match=r"8 times of 2001 nodes .* swapped\? Pass u\.T"):
        fourier_features(t, U[:, [0, 1, 2, 2, 1, 0, 1, 2]].T)


def test_own_measurements_say_nothing_of_their_signals():
    assert measure_signals(T, np.column_stack([U, 0 * T])).status.name == "DONE"
