"""Features by the analytic signal and by wavelets: what is refused and what is said."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.analytic import NodeProfiles, hilbert_features, wavelet_features

T = 0.02 * np.arange(1500)
TWO = np.stack([np.sin(2 * np.pi * T), 2.0 * np.sin(4 * np.pi * T + 1.0)], axis=1)
BOTH = pytest.mark.parametrize("features", [hilbert_features, wavelet_features])
Features = Callable[..., NodeProfiles]


@BOTH
def test_sound_signals_are_measured_without_a_word(features: Features) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = features(T, TWO)
    np.testing.assert_allclose(found.frequency, [1.0, 2.0], rtol=0.01)
    np.testing.assert_allclose(found.amplitude, [1.0, 2.0], rtol=0.02)


@BOTH
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused_by_node(features: Features, bad: float) -> None:
    u = TWO.copy()
    u[700, 1] = bad
    with pytest.raises(BadInput, match="u must be finite: node 1 "):
        features(T, u)


@BOTH
def test_a_constant_signal_among_others_is_named(features: Features) -> None:
    u = np.column_stack([TWO, np.full(len(T), 3.0)])
    with pytest.warns(UserWarning, match="never changes"):
        found = features(T, u)
    assert found.amplitude[2] == 0.0


@pytest.mark.parametrize("frequency", [0.02, 0.05, 0.1, 0.12])
def test_a_signal_below_the_wavelets_is_named(frequency: float) -> None:
    slow = np.sin(2 * np.pi * frequency * T + 0.3)[:, None]
    with pytest.warns(UserWarning, match="node 0 .* slower than the lowest frequency, 0.167"):
        wavelet_features(T, slow)
