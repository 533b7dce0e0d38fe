"""Measures of oscillations: pure functions of times t (T,) and signals u (T, N)."""

from chimera_hpc.measures.fourier import (
    FEATURES,
    FourierFeatures,
    WindowLines,
    fourier_features,
    window_lines,
)
from chimera_hpc.measures.incoherence import (
    discontinuity_measure,
    local_sigma,
    order_parameter,
    range_of,
    sigma,
    strength_of_incoherence,
)
from chimera_hpc.measures.synthetic import synthetic_profiles, synthetic_signal

__all__ = [
    "FEATURES",
    "FourierFeatures",
    "WindowLines",
    "discontinuity_measure",
    "fourier_features",
    "local_sigma",
    "order_parameter",
    "range_of",
    "sigma",
    "strength_of_incoherence",
    "synthetic_profiles",
    "synthetic_signal",
    "window_lines",
]
