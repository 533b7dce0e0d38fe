"""Every kernel against its slow twin, compiled and as plain Python."""

import os
import subprocess
import sys

import naive
import numba
import numpy as np
import pytest

from chimera_hpc.measures.fourier import FEATURES, fourier_features, window_lines
from chimera_hpc.measures.incoherence import local_sigma, order_parameter, sigma

CLOCKS = ("ring", "own")
MEANS = ("circular", "arithmetic")
ORIGINS = ("window", "absolute")


def oscillators(n_times=700, n_nodes=4, seed=1):
    """Times and relaxation-like signals with wandering frequencies, harmonics and noise."""
    rng = np.random.default_rng(seed)
    t = 50 + 0.02 * np.arange(n_times)
    frequency = 2.0 + 0.4 * rng.uniform(-1, 1, n_nodes)
    wander = 0.2 * np.sin(0.7 * t[:, None] + rng.uniform(0, 6, n_nodes))
    angle = 2 * np.pi * frequency * t[:, None] + wander + rng.uniform(0, 6, n_nodes)
    return t, 0.1 + np.tanh(3 * np.sin(angle)) + 0.5 * np.cos(angle) + 0.1 * np.cos(3 * angle + 1)


def assert_same_features(features, expected, tolerance):
    phase = FEATURES.index("phase")
    difference = features.as_array() - expected
    difference[phase] = naive.wrap(difference[phase])
    for name, row, reference in zip(FEATURES, difference, expected, strict=True):
        assert np.abs(row).max() <= tolerance * max(np.abs(reference).max(), 1.0), name


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("phase_mean", MEANS)
@pytest.mark.parametrize("time_origin", ORIGINS)
def test_three_steps_equal_rfft_polyfit_and_lstsq(clock, phase_mean, time_origin):
    t, u = oscillators()
    options = {"window_reference": clock, "phase_mean": phase_mean, "time_origin": time_origin}
    features = fourier_features(t, u, **options)
    assert features.n_windows >= 3
    assert_same_features(features, naive.fourier_features(t, u, **options), 1e-10)


@pytest.mark.parametrize("refine", ["parabola", "sine-fit"])
def test_r_squared_is_the_share_of_the_variance_that_the_fit_explains(refine):
    t, u = oscillators()
    found = window_lines(t, u, refine=refine)
    first, last = int(found.first[0, 1]), int(found.last[0, 1])
    y, time = u[first : last + 1], t[first : last + 1, None] - t[first]
    angle = 2 * np.pi * found.frequency[:, 1] * time + found.phase[:, 1]
    rest = y - found.baseline[:, 1] - found.amplitude[:, 1] * np.cos(angle)
    expected = 1 - (rest**2).sum(axis=0) / ((y - y.mean(axis=0)) ** 2).sum(axis=0)
    np.testing.assert_allclose(found.r_squared[:, 1], expected, rtol=1e-9)
    mean = fourier_features(t, u, refine=refine).r_squared
    np.testing.assert_allclose(mean, found.r_squared.mean(axis=1), rtol=1e-12)


@pytest.mark.parametrize(
    ("n_peaks", "n_overlap", "reference_node"), [(3, 0, 1), (4, 3, 2), (6, 2, 3), (12, 11, 0)]
)
def test_other_windows_equal_the_twin(n_peaks, n_overlap, reference_node):
    t, u = oscillators()
    options = {"n_peaks": n_peaks, "n_overlap": n_overlap, "reference_node": reference_node}
    expected = naive.fourier_features(t, u, **options)
    assert_same_features(fourier_features(t, u, **options), expected, 1e-10)


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("time_origin", ORIGINS)
def test_sine_fit_equals_a_general_optimiser(clock, time_origin):
    t, u = oscillators()
    options = {"window_reference": clock, "refine": "sine-fit", "time_origin": time_origin}
    features = fourier_features(t, u, **options)
    # the optimiser stops where its cost no longer changes: frequencies to 1e-8, times 2 pi t
    tolerance = 1e-7 if time_origin == "window" else 1e-5
    assert_same_features(features, naive.fourier_features(t, u, **options), tolerance)


def test_features_of_white_noise_equal_the_twin():
    rng = np.random.default_rng(3)
    t = np.arange(300) * 0.1
    u = rng.normal(size=(300, 3))
    assert_same_features(fourier_features(t, u), naive.fourier_features(t, u), 1e-10)


@pytest.mark.parametrize("groups", [1, 2, 3, 5])
def test_local_sigma_equals_its_twin(groups):
    x = np.random.default_rng(0).normal(size=(1500, 5))
    np.testing.assert_allclose(local_sigma(x, groups), naive.local_sigma(x, groups), rtol=1e-12)
    assert sigma(x) == pytest.approx(naive.local_sigma(x, 1)[0], rel=1e-12)


def test_order_parameter_equals_its_twin():
    u, w = np.random.default_rng(0).normal(size=(2, 1500, 5))
    assert order_parameter(u, w) == pytest.approx(naive.order_parameter(u, w), rel=1e-12)


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="this is the run without JIT")
def test_twins_agree_without_jit():
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", __file__],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "1 skipped" in run.stdout
