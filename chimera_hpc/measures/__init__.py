"""Measures of oscillations: pure functions of times t (T,) and signals u (T, N).

The functions are loaded when they are first used, because most of them load kernels.
"""

from chimera_hpc.base.public import load_on_use

TYPE_CHECKING = False

if TYPE_CHECKING:
    from chimera_hpc.measures.acm import adaptive_coherence
    from chimera_hpc.measures.analytic import hilbert_features, wavelet_features
    from chimera_hpc.measures.centres import centre_of_mass
    from chimera_hpc.measures.coherence import chimera_index, metastability
    from chimera_hpc.measures.correlations import g0, h0
    from chimera_hpc.measures.fourier import fourier_features
    from chimera_hpc.measures.incoherence import sigma
    from chimera_hpc.measures.incoherence import strength_of_run as strength_of_incoherence
    from chimera_hpc.measures.order_parameters import (
        community_order,
        local_order,
        order_parameter,
    )
    from chimera_hpc.measures.phase_angles import phases
    from chimera_hpc.measures.phase_velocity import mean_phase_velocity, plateau
    from chimera_hpc.measures.variation import total_variations

_HOMES = {
    "adaptive_coherence": "acm",
    "centre_of_mass": "centres",
    "chimera_index": "coherence",
    "community_order": "order_parameters",
    "fourier_features": "fourier",
    "g0": "correlations",
    "h0": "correlations",
    "hilbert_features": "analytic",
    "local_order": "order_parameters",
    "mean_phase_velocity": "phase_velocity",
    "metastability": "coherence",
    "order_parameter": "order_parameters",
    "phases": "phase_angles",
    "plateau": "phase_velocity",
    "sigma": "incoherence",
    "strength_of_incoherence": "incoherence",
    "total_variations": "variation",
    "wavelet_features": "analytic",
}
_OTHER_NAMES = {"strength_of_incoherence": "strength_of_run"}

__all__ = [
    "adaptive_coherence",
    "centre_of_mass",
    "chimera_index",
    "community_order",
    "fourier_features",
    "g0",
    "h0",
    "hilbert_features",
    "local_order",
    "mean_phase_velocity",
    "metastability",
    "order_parameter",
    "phases",
    "plateau",
    "sigma",
    "strength_of_incoherence",
    "total_variations",
    "wavelet_features",
]

__getattr__, __dir__ = load_on_use(
    __name__,
    {name: (f"{__name__}.{home}", _OTHER_NAMES.get(name, name)) for name, home in _HOMES.items()},
)
