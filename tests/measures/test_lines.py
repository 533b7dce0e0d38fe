"""The kernels of one window against NumPy's transform and least squares."""

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.measures import lines

lengths = st.integers(5, 400)
seeds = st.integers(0, 2**32 - 1)


def centred(y):
    """Work arrays with the centred samples in place, and what `centre` returned."""
    work = lines.work_arrays(len(y))
    return work, lines.centre(np.asarray(y, dtype=float), 0, len(y), work.z, work.sums)


def found_bin(y, guess):
    work, (_, energy, alternating) = centred(y)
    at = lines.dominant_bin(work.z, len(y), energy, alternating, guess, work.power, work.turn)
    return at, work.power


@given(lengths, seeds)
def test_centre_gives_mean_energy_and_nyquist_sum(n, seed):
    y = np.random.default_rng(seed).normal(3.0, 1.0, n)
    work, (mean, energy, alternating) = centred(y)
    assert mean == pytest.approx(y.mean(), rel=1e-13)
    assert energy == pytest.approx(((y - y.mean()) ** 2).sum(), rel=1e-12)
    np.testing.assert_allclose(work.z[:n], y - y.mean(), atol=1e-13)
    assert not work.z[n:].any()
    if n % 2 == 0:
        assert alternating == pytest.approx((y * (-1.0) ** np.arange(n)).sum(), abs=1e-11)


@pytest.mark.parametrize("value", [0.1, 1e9 / 3, -1e-300])
def test_equal_samples_have_exactly_no_energy(value):
    _, (mean, energy, _) = centred(np.full(227, value))
    assert energy == 0.0
    assert mean == value


def test_centre_reads_only_its_window():
    x = np.concatenate([np.full(10, np.nan), np.arange(70.0), np.full(10, np.nan)])
    work = lines.work_arrays(70)
    assert lines.centre(x, 10, 70, work.z, work.sums)[0] == pytest.approx(34.5)


@given(lengths, seeds, st.floats(1e-3, np.pi))
def test_line_sums_are_the_sums_of_the_definition(n, seed, w):
    y = np.random.default_rng(seed).normal(size=n)
    work, _ = centred(y)
    c, s = lines.line_sums(work.z, n, w, work.turn)
    expected = ((y - y.mean()) * np.exp(1j * w * np.arange(n))).sum()
    assert abs(complex(c, s) - expected) < 1e-11 * n


@given(lengths, seeds, st.integers(-5, 300), st.floats(0.0, 3.0))
def test_dominant_bin_is_that_of_the_full_transform_from_any_guess(n, seed, guess, signal):
    rng = np.random.default_rng(seed)
    line = np.cos(rng.uniform(0, np.pi) * np.arange(n) + rng.uniform(0, 6))
    y = rng.normal(size=n) + signal * line
    spectrum = np.abs(np.fft.rfft(y - y.mean())) ** 2
    at, power = found_bin(y, guess)
    assert at == 1 + np.argmax(spectrum[1:])
    near = np.arange(max(at - 1, 1), min(at + 1, n // 2) + 1)
    np.testing.assert_allclose(power[near], spectrum[near], rtol=1e-9, atol=1e-12 * n)


@given(st.lists(st.tuples(st.integers(5, 90), st.integers(1, 20)), min_size=2, max_size=12), seeds)
def test_rotations_kept_from_other_windows_change_no_bit(windows, seed):
    # Bins whose numbers differ by SLOTS, and the same bin of other lengths, share their place.
    x = np.random.default_rng(seed).normal(size=90)
    shared = lines.work_arrays(90)
    for n, guess in windows:
        alone = lines.work_arrays(90)
        found = []
        for work in (shared, alone):
            out = np.empty(5)
            found.append((lines.window_line(x, 0, n, guess, False, work, out), out.tobytes()))
        assert found[0] == found[1]


@pytest.mark.parametrize("guess", [1, 9, 20, 40, 113])
def test_of_two_equal_lines_neither_hides_a_larger_third(guess):
    i = np.arange(227)
    y = sum(a * np.cos(2 * np.pi * k * i / 227) for a, k in [(1.0, 9), (1.0, 20), (1.001, 100)])
    assert found_bin(y, guess)[0] == 100


def test_a_nyquist_line_hides_no_larger_one():
    i = np.arange(100)
    y = np.cos(0.18 * np.pi * i) + 1.001 * np.cos(0.8 * np.pi * i) + 0.4 * (-1.0) ** i
    assert found_bin(y, 9)[0] == 40


def test_a_dominant_line_ends_the_search_after_its_neighbours():
    n = 227
    work, (_, energy, alternating) = centred(np.cos(2 * np.pi * 9 * np.arange(n) / n))
    work.power[:] = -1.0
    lines.dominant_bin(work.z, n, energy, alternating, 9, work.power, work.turn)
    assert np.flatnonzero(work.power >= 0).tolist() == [8, 9, 10]


@pytest.mark.parametrize(
    ("amplitudes", "shift"),
    [((1, 2, 1), 0.0), ((1, 2, 2), 0.5), ((0, 3, 2), 0.25), ((2, 3, 0), -0.25), ((1, 1, 1), 0.0)],
)
def test_parabola_shift_by_hand(amplitudes, shift):
    power = np.zeros(20)
    power[4:7] = np.square(amplitudes)
    assert lines.parabola_shift(power, 5, 30) == pytest.approx(shift, abs=1e-15)


@pytest.mark.parametrize(("k", "n"), [(1, 30), (15, 30), (15, 31)])
def test_no_parabola_at_the_edges_of_the_spectrum(k, n):
    power = np.arange(20.0)
    assert lines.parabola_shift(power, k, n) == 0.0


@given(st.integers(12, 400), seeds, st.floats(0.0, 1.0))
def test_fit_is_the_least_squares_solution(n, seed, place):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=n)
    w = 2 * np.pi / n + place * (np.pi - 4 * np.pi / n)  # half a bin and more from both edges
    work, (mean, _, _) = centred(y)
    a, b, k, gain, angle = lines.fit_at(work.z, n, w, work.turn)
    amplitude, phase, baseline = naive.linear_fit(y, 1.0, w / (2 * np.pi))
    assert np.hypot(a, b) == pytest.approx(amplitude, rel=1e-10, abs=1e-12)
    assert abs(naive.wrap(np.arctan2(-b, a) - angle - phase)) < 1e-9
    assert mean + k == pytest.approx(baseline, abs=1e-12)
    residual = y - baseline - amplitude * np.cos(w * np.arange(n) + phase)
    energy = ((y - y.mean()) ** 2).sum()
    assert energy - gain == pytest.approx((residual**2).sum(), rel=1e-9)


def sine_fit(y, w):
    n = len(y)
    work, (_, energy, _) = centred(y)
    work.z_s[: len(work.z)] = work.z * (np.arange(len(work.z)) - (n - 1) / 2)
    return lines.sine_fit(work.z, work.z_s, n, energy, w, work.turn)


@given(
    st.integers(20, 1000),
    st.floats(2.0, 0.4 * 20),
    st.floats(-0.6, 0.6),
    st.floats(0, 2 * np.pi),
)
def test_sine_fit_finds_the_frequency_of_a_pure_line(n, periods, off, phase):
    w = 2 * np.pi * periods / n
    y = 0.3 + 2.0 * np.cos(w * np.arange(n) + phase)
    assert sine_fit(y, w + off * 2 * np.pi / n) == pytest.approx(w, rel=1e-11)


def test_sine_fit_stays_within_one_bin_of_its_start():
    n = 200
    y = np.cos(2 * np.pi * 12 * np.arange(n) / n)
    start = 2 * np.pi * 9 / n
    assert abs(sine_fit(y, start) - start) <= 2 * np.pi / n * (1 + 1e-12)


@given(st.integers(10, 120), seeds)
def test_sine_fit_of_noise_explains_no_less_than_its_start(n, seed):
    y = np.random.default_rng(seed).normal(size=n)
    work, _ = centred(y)
    start = 2 * np.pi * 3.3 / n
    end = sine_fit(y, start)
    gains = [lines.fit_at(work.z, n, w, work.turn)[3] for w in (start, end)]
    assert gains[1] >= gains[0] * (1 - 1e-9)
