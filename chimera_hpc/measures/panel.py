"""Measures of other authors for ``[measures] panel``. Kernels load when a run is measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chimera_hpc.measures.measure import Measure, MeasuredRun

BAD_FIT = 0.5
"""R^2 below which a sine does not describe a node: more of its variance is in the rest."""


def _order(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.order_parameters import run_orders

    found = run_orders(run.orbits, run.around)
    return found.mean, found.deviation, float(found.local.mean()), float(found.local.min())


def _communities(run: MeasuredRun) -> Sequence[float]:
    """The groups of neighbouring nodes of SI are the communities."""
    from chimera_hpc.measures.order_parameters import run_communities

    members = np.array_split(np.arange(run.u.shape[1]), run.settings.groups)
    _, variance, chi = run_communities(run.orbits, members)
    return chi, float(variance.mean())


def _correlations(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.correlations import run_correlations

    near, all_pairs, time = run_correlations(run.orbits.x, run.orbits.x_mean, run.around)
    return float(near.mean()), float(near.std()), float(all_pairs.mean()), time


def _velocity(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.phase_velocity import plateau, run_velocity

    velocity = run_velocity(run.t, run.orbits)
    return float(velocity.mean()), float(velocity.std()), plateau(velocity)


def _centre_of_mass(run: MeasuredRun) -> Sequence[float]:
    distance = np.sqrt(np.square(run.orbits.x_mean) + np.square(run.orbits.y_mean))
    return float(distance.mean()), float(distance.std())


def _acm(run: MeasuredRun) -> Sequence[float]:
    from chimera_hpc.measures.acm import run_coherence

    return run_coherence(run.orbits.x, run.orbits.x_mean)


def _fit(run: MeasuredRun) -> Sequence[float]:
    r_squared = run.features.r_squared[np.isfinite(run.features.r_squared)]
    if not r_squared.size:
        return (float("nan"),) * 3
    bad = np.count_nonzero(r_squared < BAD_FIT) / r_squared.size
    return float(np.median(r_squared)), float(r_squared.min()), bad


ORDER = Measure(lambda _: ("R", "R_std", "R_local", "R_local_min"), _order)
COMMUNITIES = Measure(lambda _: ("chi", "lambda"), _communities)
CORRELATIONS = Measure(lambda _: ("g0", "g0_std", "g0_global", "h0"), _correlations)
VELOCITY = Measure(lambda _: ("omega", "omega_std", "plateau"), _velocity)
CENTRE_OF_MASS = Measure(lambda _: ("centre_of_mass", "centre_of_mass_std"), _centre_of_mass)
ACM = Measure(lambda _: ("acm", "acm_delays"), _acm)
FIT = Measure(lambda _: ("r_squared", "r_squared_min", "badly_fitted"), _fit)
