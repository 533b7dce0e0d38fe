"""What the features mean: exact answers, conventions, outcomes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.base.status import Status
from chimera_hpc.measures.fourier import FEATURES, fourier_features, window_lines, wrap

T = np.arange(2001) * 0.01


def cosines(frequency, phase=0.0, amplitude=1.0, baseline=0.0, t=T):
    """Pure lines (T, N), one node for each entry of the broadcast parameters."""
    a, f, p, b = np.broadcast_arrays(*map(np.atleast_1d, (amplitude, frequency, phase, baseline)))
    return a * np.cos(2 * np.pi * f * t[:, None] + p) + b


@given(
    st.floats(0.1, 100.0),
    st.floats(0.8, 12.0),
    st.floats(-3.1, 3.1),
    st.floats(-10.0, 10.0),
    st.floats(-1000.0, 1000.0),
)
def test_sine_fit_recovers_a_pure_line_in_absolute_time(amplitude, frequency, phase, mean, start):
    t = start + T
    u = cosines(frequency, phase, amplitude, mean, t)
    f = fourier_features(t, u, refine="sine-fit", time_origin="absolute")
    assert f.status is Status.DONE
    assert f.amplitude[0] == pytest.approx(amplitude, rel=1e-9)
    assert f.frequency[0] == pytest.approx(frequency, rel=1e-10)
    assert abs(wrap(f.phase - phase)[0]) < 1e-6
    assert f.baseline[0] == pytest.approx(mean, abs=1e-9 * (amplitude + abs(mean)))
    assert f.as_array()[4:].max() < 1e-6 * amplitude + 1e-6


def test_a_window_is_ten_maxima_and_nine_periods_with_both_ends():
    # period 25.1 samples: nine of them and both ends are 227 samples, as in the paper's figure
    found = window_lines(T, cosines(1 / 0.251))
    assert (found.last - found.first + 1)[0, 0] == 227
    # the raw line would be bin 9; the parabola moves it, by less than half a bin
    assert 0 < abs(found.frequency[0, 0] - 9 / 2.27) < 0.5 / 2.27


def test_windows_in_a_row_share_n_overlap_maxima():
    found = window_lines(T, cosines(2.0), n_peaks=6, n_overlap=2)
    assert np.diff(found.first[0]).tolist() == [200] * (found.counts[0] - 1)  # 4 periods of 50
    assert (found.last - found.first == 250).all()


def test_three_steps_are_within_their_bias_of_a_pure_line():
    f = fourier_features(T, cosines(4.0, 0.0, 1.5, 0.25))
    assert f.frequency[0] == pytest.approx(4.0, abs=0.02)
    assert f.amplitude[0] == pytest.approx(1.5, abs=0.01)
    assert f.baseline[0] == pytest.approx(0.25, abs=0.01)


def test_phase_is_relative_to_the_clocks_maxima():
    lag = np.array([0.0, 0.5, -1.0, 3.0])
    f = fourier_features(T, cosines(2.0, 0.7 - lag), refine="sine-fit")
    np.testing.assert_allclose(wrap(f.phase - f.phase[0]), -lag, atol=1e-9)
    assert abs(f.phase[0]) < 2 * np.pi * 2.0 * 0.01  # a maximum, to within a sample


def test_own_clock_puts_every_node_at_a_maximum():
    f = fourier_features(T, cosines([2.0, 2.5, 3.3], [0.0, 1.0, 2.0]), window_reference="own")
    assert np.abs(f.phase).max() < 0.3
    np.testing.assert_allclose(f.frequency, [2.0, 2.5, 3.3], atol=0.02)


def test_own_clock_counts_the_windows_of_the_slowest_node():
    u = cosines([1.0, 4.0])
    own = window_lines(T, u, window_reference="own")
    assert own.counts.tolist() == [2, 14]
    assert np.isfinite(own.amplitude).sum(axis=1).tolist() == [2, 14]
    f = fourier_features(T, u, window_reference="own")
    assert f.n_windows == 2
    assert np.isfinite(f.as_array()).all()


def test_own_clock_gives_each_node_the_same_bits_alone_as_in_company():
    u = cosines([1.3, 2.0, 4.1], [0.1, 0.2, 0.3])
    together = fourier_features(T, u, window_reference="own").as_array()
    for j in range(3):
        alone = fourier_features(T, u[:, j : j + 1], window_reference="own").as_array()
        assert np.array_equal(together[:, j : j + 1], alone)


def test_reference_node_chooses_the_clock():
    u = cosines([1.0, 4.0])
    assert fourier_features(T, u, reference_node=0).n_windows == 2
    assert fourier_features(T, u, reference_node=1).n_windows == 14


def alternating_phases(low, high):
    """Two nodes: a clock, and one with phase low in windows 0, 2, .. 12 and high in 1, 3, .. 11."""
    t = np.arange(12001) * 0.01
    late = np.floor((t - 1.005) / 9.0) % 2 == 1  # windows begin at t = 1, 10, 19, ...
    phases = np.stack([0 * t, np.where(late, high, low)], axis=1)
    return t, np.cos(2 * np.pi * t[:, None] + phases)


def test_circular_and_arithmetic_means_differ_across_the_cut():
    # phases just below pi and just above -pi: opposite signs, nearly one direction
    t, u = alternating_phases(np.pi - 0.2, np.pi + 0.2)
    options = {"n_overlap": 1, "refine": "sine-fit"}
    circular = fourier_features(t, u, **options)
    arithmetic = fourier_features(t, u, phase_mean="arithmetic", **options)
    # by hand: 7 times -0.2 and 6 times 0.2 about pi have mean -0.2 / 13, and deviations with
    # square sum 13 * 0.04 - 13 * (0.2 / 13)^2 = 12 * 0.2075^2
    assert wrap(circular.phase - np.pi)[1] == pytest.approx(-0.2 / 13, abs=3e-3)
    assert circular.phase_std[1] == pytest.approx(0.2075, abs=2e-3)
    # 7 times 2.94 and 6 times -2.94
    assert arithmetic.phase[1] == pytest.approx((np.pi - 0.2) / 13, abs=3e-3)
    assert arithmetic.phase_std[1] == pytest.approx(3.053, abs=5e-3)
    # nothing but the phase changes
    others = [i for i, name in enumerate(FEATURES) if not name.startswith("phase")]
    assert np.array_equal(circular.as_array()[others], arithmetic.as_array()[others])


def test_means_and_deviations_are_those_of_the_windows_with_one_degree_of_freedom_less():
    t, u = alternating_phases(-0.4, 0.4)
    f = fourier_features(t, u, phase_mean="arithmetic")
    found = window_lines(t, u)
    assert f.n_windows == found.counts[0] == found.phase.shape[1] == 22
    for name in ("amplitude", "frequency", "phase", "baseline"):
        values = getattr(found, name)
        np.testing.assert_allclose(getattr(f, name), values.mean(axis=1), atol=1e-14)
        deviation = values.std(axis=1, ddof=1)
        np.testing.assert_allclose(getattr(f, name + "_std"), deviation, rtol=1e-9, atol=1e-14)


def test_one_window_has_means_but_no_deviations():
    f = fourier_features(T[:1101], cosines(1.0, [0.0, 1.0])[:1101])
    assert (f.status, f.n_windows) == (Status.DONE, 1)
    assert np.isfinite(f.as_array()[:4]).all()
    assert np.isnan(f.as_array()[4:]).all()


def test_absolute_phase_is_the_windows_phase_turned_back():
    t = 123.4 + T
    u = cosines([2.0, 2.01], [0.3, 1.0], t=t)
    window = window_lines(t, u)
    absolute = window_lines(t, u, time_origin="absolute")
    turned = window.phase - 2 * np.pi * window.frequency * t[window.first]
    np.testing.assert_allclose(wrap(absolute.phase - turned), 0.0, atol=1e-9)


# --- outcomes ------------------------------------------------------------------------------------


def assert_no_features(f, status):
    assert f.status is status
    assert f.n_windows == 0
    assert f.as_array().shape[0] == 8
    assert np.isnan(f.as_array()).all()


def test_a_still_run_is_steady_however_many_tiny_maxima_it_has():
    u = 1.7 + 1e-3 * np.random.default_rng(0).normal(size=(2001, 3))
    assert_no_features(fourier_features(T, u), Status.STEADY)
    f = fourier_features(T, u, steady_threshold=1e-4)  # asked for, they are analysed
    assert f.status is Status.DONE
    assert np.isfinite(f.as_array()).all()


@pytest.mark.filterwarnings("ignore:fourier_features:UserWarning")
def test_the_limit_is_on_the_mean_over_nodes_of_the_deviation():
    u = np.concatenate([np.full((2001, 3), 2.0), cosines(2.0, amplitude=np.sqrt(2))], axis=1)
    # deviations 0, 0, 0, 1 over 2001 samples, whose mean is close to 1/4
    deviation = u.std(axis=0).mean()
    assert (
        fourier_features(T, u, reference_node=3, steady_threshold=deviation * 1.001).status
        is Status.STEADY
    )
    assert (
        fourier_features(T, u, reference_node=3, steady_threshold=deviation * 0.999).status
        is Status.DONE
    )
    for still in (0.0, 10.0):
        assert fourier_features(T, u, steady_threshold=still).deviation == pytest.approx(
            deviation, rel=1e-12
        )


def test_a_constant_run_has_no_window_if_nothing_counts_as_still():
    assert_no_features(
        fourier_features(T, np.ones((2001, 2)), steady_threshold=0.0), Status.NO_WINDOW
    )


@pytest.mark.parametrize("clock", ["ring", "own"])
def test_few_long_periods_leave_no_window(clock):
    u = cosines(0.45, [0.0, 1.0])  # nine maxima
    assert_no_features(fourier_features(T, u, window_reference=clock), Status.NO_WINDOW)
    assert fourier_features(T, u, window_reference=clock, n_peaks=8).status is Status.DONE


def test_own_clock_has_no_window_as_soon_as_one_node_has_none():
    u = cosines([2.0, 0.3])
    assert_no_features(fourier_features(T, u, window_reference="own"), Status.NO_WINDOW)
    assert fourier_features(T, u, window_reference="ring").status is Status.DONE


@pytest.mark.filterwarnings("ignore:fourier_features:UserWarning")
def test_a_node_that_stands_still_among_others_has_zeros():
    u = np.concatenate([cosines(2.0), np.full((2001, 1), 0.1)], axis=1)
    f = fourier_features(T, u)
    assert f.status is Status.DONE
    assert f.as_array()[:, 1].tolist() == [0, 0, 0, 0.1, 0, 0, 0, 0]


def test_plateau_maxima_count_once():
    u = np.tile([0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, -1.0], 40)[:, None]
    found = window_lines(np.arange(320.0), u)
    assert (found.last - found.first == 72).all()
    assert found.first[0, 0] == 3


def test_a_drift_is_bin_one_without_a_parabola():
    clock = cosines(2.0)
    drift = np.linspace(-5, 5, 2001)[:, None]
    found = window_lines(T, np.concatenate([clock, drift], axis=1))
    n = found.last - found.first + 1
    np.testing.assert_allclose(found.frequency[1], 1 / (0.01 * n[0]), rtol=1e-12)
    assert np.isfinite(found.phase).all()


@pytest.mark.parametrize("period", [20, 21])
def test_a_line_at_the_last_bin_has_no_parabola(period):
    i = np.arange(1000)
    zigzag = 0.5 + 0.75 * (-1.0) ** i
    u = np.stack([np.cos(2 * np.pi * i / period), zigzag], axis=1)
    found = window_lines(i * 0.1, u)
    n = (found.last - found.first + 1)[0]
    assert np.allclose(found.frequency[1], (n // 2) / (0.1 * n), rtol=1e-12)
    assert np.isfinite(found.phase).all()


def test_the_nyquist_line_of_an_even_window_is_exact():
    i = np.arange(1000)
    clock = np.cos(2 * np.pi * (i - 5) / 9)  # windows of 82 samples, from sample 5
    f = window_lines(i * 1.0, np.stack([clock, 0.5 + 0.75 * (-1.0) ** i], axis=1))
    n = (f.last - f.first + 1)[0]
    assert (n % 2 == 0).all()
    np.testing.assert_allclose(f.amplitude[1], 0.75, rtol=1e-12)
    np.testing.assert_allclose(f.baseline[1], 0.5, rtol=1e-12)
    np.testing.assert_allclose(f.frequency[1], 0.5, rtol=1e-12)
    expected = np.where(f.first[0] % 2 == 0, 0.0, -np.pi)
    np.testing.assert_allclose(f.phase[1], expected, atol=1e-12)


# --- input ---------------------------------------------------------------------------------------


def test_layout_type_and_protection_of_the_input_change_no_bit():
    u = cosines([2.0, 2.1, 2.2], [0.1, 0.2, 0.3]).astype(np.float32)
    reference = fourier_features(T, u.astype(np.float64)).as_array()
    frozen = np.asfortranarray(u.astype(np.float64))
    frozen.setflags(write=False)
    strided = np.repeat(u, 2, axis=1)[:, ::2]
    for same in (u, u.tolist(), np.asfortranarray(u), frozen, strided):
        assert np.array_equal(fourier_features(T, same).as_array(), reference)


def test_input_is_left_as_it_was():
    u = np.asfortranarray(cosines([2.0, 2.1]))
    before = u.copy()
    fourier_features(T, u, refine="sine-fit")
    assert np.array_equal(u, before)


def test_as_array_has_the_rows_of_features():
    f = fourier_features(T, cosines([2.0, 2.1]))
    for name, row in zip(FEATURES, f.as_array(), strict=True):
        assert np.array_equal(getattr(f, name), row)
