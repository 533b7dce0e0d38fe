"""The measures of the default panel. Kernels are imported when a run is measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.measures.measure import Measure, MeasuredRun


def _variations(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.variation import total_variations

    return total_variations(run.features, pairs=run.pairs)


def _paper_printed(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.conventions import PRESETS
    from chimera_hpc.measures.fourier import measure_signals
    from chimera_hpc.measures.variation import total_variations

    settings = {**run.settings.options(), **PRESETS["paper-printed"]}
    features = measure_signals(run.t, run.u, **settings)
    return *total_variations(features, pairs=run.pairs), float(features.status)


def _sigma(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.incoherence import sigma

    return sigma(run.u), sigma(run.w)


def _range(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.incoherence import range_of

    return (range_of(run.u),)


def _order_parameter(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.incoherence import order_parameter

    return (order_parameter(run.u, run.w),)


def _local_sigma(run: MeasuredRun) -> NDArray[np.float64]:
    from chimera_hpc.measures.incoherence import local_sigma

    return local_sigma(run.u, run.settings.groups)


VARIATIONS = Measure(lambda _: ("V_theta", "V_a", "V_Omega"), _variations)
PAPER_PRINTED = Measure(
    lambda _: ("V_theta_printed", "V_a_printed", "V_Omega_printed", "status_printed"),
    _paper_printed,
)
SIGMA = Measure(lambda _: ("sigma_1", "sigma_2"), _sigma)
DEVIATION = Measure(lambda _: ("std_u",), lambda run: (run.features.deviation,))
RANGE = Measure(lambda _: ("range_u",), _range)
ORDER_PARAMETER = Measure(lambda _: ("order_parameter",), _order_parameter)
DISTANCE = Measure(lambda _: ("distance",), lambda run: (run.distance,))
LOCAL_SIGMA = Measure(
    lambda features: [f"local_sigma_{m}" for m in range(1, features.groups + 1)], _local_sigma
)
