from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.measures.fourier import fourier_features
from chimera_hpc.measures.quality import quality

T = np.arange(2001) * 0.01
FREQUENCY = np.array([2.0, 2.0, 2.5])
U = np.cos(2 * np.pi * FREQUENCY * T[:, None])


def test_the_fastest_node_counts_the_samples_and_the_median_node_the_fit() -> None:
    noise = np.random.default_rng(0).normal(size=T.size)
    u = U + np.outer(noise, [0.0, 0.0, 0.5])
    samples, r_squared = quality(fourier_features(T, u, refine="sine-fit"), 0.01)
    assert samples == pytest.approx(40.0, rel=1e-2)
    assert r_squared == pytest.approx(1.0, abs=1e-3)


def test_constant_nodes_do_not_count() -> None:
    u = np.column_stack([U, np.zeros((T.size, 4))])
    with pytest.warns(UserWarning, match="column 3, 4, 5, 6 of u never changes"):
        features = fourier_features(T, u)
    assert quality(features, 0.01) == quality(fourier_features(T, U), 0.01)


def test_nothing_is_known_of_a_run_that_does_not_oscillate() -> None:
    assert np.isnan(quality(fourier_features(T, 0.0 * U), 0.01)).all()


def test_noise_is_fitted_worse_than_the_limit_for_classes() -> None:
    noise = np.random.default_rng(0).normal(size=(T.size, 5))
    assert 0.15 < quality(fourier_features(T, noise), 0.01)[1] < 0.35
