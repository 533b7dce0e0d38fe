"""The paper's synthetic signal (eq. (B1)): what it is, and what the method makes of it."""

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.fourier import fourier_features, wrap
from chimera_hpc.measures.synthetic import profile_error, synthetic_profiles, synthetic_signal

T = 500 + 0.01 * np.arange(50_001)


@pytest.fixture(scope="module")
def signal():
    return synthetic_signal(T)


def errors(features):
    """Largest errors in frequency, amplitude and phase."""
    true = synthetic_profiles()
    return (
        np.abs(features.frequency - true.frequency).max(),
        np.abs(features.amplitude - true.amplitude).max(),
        np.abs(wrap(features.phase - true.phase)).max(),
    )


def piece(s, k):
    """The k-th parabola of the paper's cases, zero at k/5 and (k + 1)/5."""
    return (s - k / 5) * ((k + 1) / 5 - s)


def test_profiles_are_the_papers_cases():
    true = synthetic_profiles()
    for j in range(1, 101):
        s = (j - 1) / 100
        # both pieces vanish where they meet, so it does not matter whose the border is
        k = next(k for k in range(5) if s <= (k + 1) / 5 + 1e-12)
        assert true.amplitude[j - 1] == pytest.approx(1 + 20 * piece(s, k), abs=1e-13)
        bump = piece(s, k) if k in (1, 3) else 0.0
        assert true.frequency[j - 1] == pytest.approx(1 + 0.1 * bump, abs=1e-14)
        assert true.phase[j - 1] == pytest.approx(np.pi * (j - 1) / 100, abs=1e-15)


def test_profiles_at_nodes_worked_out_by_hand():
    true = synthetic_profiles()
    # node 31: s = 0.3, the middle of the second fifth: bump = 0.1^2
    assert true.amplitude[[0, 10, 20, 30]] == pytest.approx([1.0, 1.2, 1.0, 1.2], abs=1e-14)
    assert true.frequency[[10, 30, 70, 90]] == pytest.approx([1, 1.001, 1.001, 1], abs=1e-15)


def test_signal_is_eq_syntsig(signal):
    true = synthetic_profiles()
    assert signal.shape == (T.size, 100)
    for i, j in [(0, 0), (17, 31), (50_000, 99)]:
        angle = 2 * np.pi * true.frequency[j] * T[i] + true.phase[j]
        assert signal[i, j] == pytest.approx(true.amplitude[j] * np.cos(angle), abs=1e-12)


def test_other_numbers_of_nodes():
    assert synthetic_signal([0.0, 0.5], n_nodes=7).shape == (2, 7)
    with pytest.raises(BadInput, match="n_nodes must be at least 1, not 0"):
        synthetic_profiles(0)


@pytest.mark.parametrize("clock", ["own", "ring"])
@pytest.mark.parametrize("phase_mean", ["circular", "arithmetic"])
def test_sine_fit_in_absolute_time_gives_the_profiles_back(signal, clock, phase_mean):
    f = fourier_features(
        T,
        signal,
        window_reference=clock,
        refine="sine-fit",
        time_origin="absolute",
        phase_mean=phase_mean,
    )
    assert f.n_windows == 98
    frequency, amplitude, phase = errors(f)
    assert frequency <= 1e-12  # asked for: 1e-8
    assert amplitude <= 1e-10  # 1e-6
    assert phase <= 1e-8  # 1e-5


def test_three_steps_have_the_bias_of_the_parabola(signal):
    frequency, amplitude, _ = errors(fourier_features(T, signal, window_reference="own"))
    assert 1e-4 < frequency < 3e-3
    assert 1e-5 < amplitude < 1e-3


def test_three_steps_lose_the_phase_far_from_time_zero(signal):
    f = fourier_features(T, signal, window_reference="own", time_origin="absolute")
    assert errors(f)[2] > 1.0


def test_errors_of_phases_are_taken_modulo_a_turn() -> None:
    true, found = np.array([3.1, -3.1, 0.0]), np.array([-3.1, 3.1, 0.1])
    gap = 2.0 * np.pi - 6.2
    np.testing.assert_allclose(profile_error(true, found, periodic=True), [-gap, gap, -0.1])
    np.testing.assert_allclose(profile_error(true, found, periodic=False), [6.2, -6.2, -0.1])
