"""Chimeras of two populations: the reduced equations of Abrams, Mirollo, Strogatz, Wiley (2008)."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_tools import run_all
from networks_for_tests import two_populations
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from chimera_hpc.integrate.lanes import Control
from chimera_hpc.models.kuramoto_sakaguchi import KuramotoSakaguchi

BETA = 0.1
LAG = np.pi / 2 - BETA
CHIMERA = {0.2: (0.72914708, -0.20940801), 0.28: (0.58623053, None)}


def reduced(state, disparity):
    """Rates of r of the incoherent population and psi, its phase against the coherent one."""
    r, psi = state
    mu, nu = (1 + disparity) / 2, (1 - disparity) / 2
    rate_r = (1 - r * r) / 2 * (mu * r * np.cos(LAG) + nu * np.cos(psi - LAG))
    rate_psi = (1 + r * r) / (2 * r) * (mu * r * np.sin(LAG) - nu * np.sin(psi - LAG))
    return np.array([rate_r, rate_psi - mu * np.sin(LAG) - nu * r * np.sin(psi + LAG)])


def phases(n, r, psi, where):
    """Coherent population at psi, and the other around 0 with the Poisson kernel's quantiles."""
    other = 2 * np.arctan((1 - r) / (1 + r) * np.tan(np.pi * (where - 0.5)))
    return np.concatenate([np.full(n, psi), other])


def order(phase, n):
    """r of the second population, for phases (T, 2 n)."""
    return np.abs(np.exp(1j * phase[:, n:]).mean(axis=1))


def runs(n, disparity, states, t_end):
    """r(t) (T,) of each state, once for each unit of time."""
    model = KuramotoSakaguchi(two_populations(n, disparity), phase_lag=LAG)
    assert model.packed.n_shared == 2
    control = Control(t_end, 0.0, 1.0, rtol=1e-6, atol=1e-8)
    done = run_all([model] * len(states), states, control)
    return [order(run.samples.T, n) for run in done]


@pytest.mark.parametrize("disparity", CHIMERA)
def test_reduced_equations_have_the_known_chimera(disparity):
    r, psi = CHIMERA[disparity]
    found = fsolve(lambda x: reduced(x, disparity), (r, psi or -0.2), xtol=1e-13)
    assert found[0] == pytest.approx(r, abs=1e-8)
    assert psi is None or found[1] == pytest.approx(psi, abs=1e-8)


def test_oscillators_follow_the_reduced_equations():
    # Quantiles put the oscillators on the manifold of the reduction.
    n, start = 200, (0.6, -0.1)
    exact = solve_ivp(
        lambda _, x: reduced(x, 0.2), (0, 40), start, rtol=1e-10, atol=1e-12, t_eval=np.arange(41)
    )
    where = (np.arange(n) + 0.5) / n
    (r,) = runs(n, 0.2, [phases(n, *start, where)], 40.0)
    np.testing.assert_allclose(r, exact.y[0], rtol=0, atol=1e-5)


@pytest.mark.slow
def test_two_thousand_oscillators_keep_the_order_of_the_stable_chimera():
    n, (r, psi) = 1000, CHIMERA[0.2]
    rng = np.random.default_rng(8)
    states = [phases(n, r, psi, rng.random(n)) for _ in range(8)]
    means = np.array([one[50:].mean() for one in runs(n, 0.2, states, 250.0)])
    error = means.std(ddof=1) / np.sqrt(len(means))
    assert error < 0.01
    assert abs(means.mean() - r) < 3 * error


def test_chimera_past_the_hopf_bifurcation_breathes():
    n, where = 500, (np.arange(500) + 0.5) / 500
    ranges = {}
    for disparity, (r, _) in CHIMERA.items():
        _, psi = fsolve(lambda x, a=disparity: reduced(x, a), (r, -0.2))
        (found,) = runs(n, disparity, [phases(n, r - 0.05, psi, where)], 300.0)
        ranges[disparity] = np.ptp(found[:60]), np.ptp(found[-60:])
    assert ranges[0.2][1] < 0.1 * ranges[0.2][0]
    assert ranges[0.28][1] > 0.9 * ranges[0.28][0] > 0.05
