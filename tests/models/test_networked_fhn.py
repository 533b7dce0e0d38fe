"""The networked model against loops over all pairs and against SciPy."""

from __future__ import annotations

import math
from dataclasses import replace

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.run.simulate import simulate


def twin(model):
    """The slow right-hand side of a model."""
    m = model
    return lambda y: naive.networked_rhs(
        y, m.n_nodes, m.half_degree, m.sigma, m.epsilon, m.b, m.phi
    )


@settings(max_examples=40)
@given(st.integers(3, 17), st.integers(0, 99), st.sampled_from([1, LANES]))
def test_right_hand_side_equals_the_pairwise_one_in_every_lane(n, seed, lanes):
    random = np.random.default_rng(seed)
    half = int(random.integers(1, (n - 1) // 2 + 1))
    models = [
        NetworkedFHN(n, half, sigma, abs(epsilon) + 0.01, b, phi)
        for sigma, epsilon, b, phi in random.normal(size=(lanes, 4))
    ]
    y = random.uniform(-2, 2, (2 * n, lanes))
    dy = np.full_like(y, np.nan)
    params = np.stack([model.lane_params for model in models], axis=1)
    models[0].right_hand_side(y, dy, params, models[0].int_params)
    for lane, model in enumerate(models):
        expected = twin(model)(y[:, lane])
        scale = np.abs(expected).max()
        np.testing.assert_allclose(dy[:, lane], expected, rtol=0, atol=1e-13 * scale)


@pytest.fixture(scope="module")
def scipy_s():
    """A model, its start and SciPy's solution of it by the slow right-hand side."""
    model = NetworkedFHN(n_nodes=12, half_degree=4, sigma=0.3)
    start = np.random.default_rng(1).uniform(-1.5, 1.5, 24)
    slow = twin(model)
    options = {"method": "DOP853", "t_eval": 0.1 * np.arange(31), "rtol": 1e-10, "atol": 1e-12}
    return model, start, solve_ivp(lambda _, y: slow(y), (0.0, 3.0), start, **options)


@pytest.mark.parametrize("method", ["tsit5", "dopri5"])
def test_trajectory_equals_scipy_s(scipy_s, method):
    model, start, solution = scipy_s
    u0, v0 = start[:12], start[12:]
    run = simulate(model, u0=u0, v0=v0, t_end=3.0, t_step=0.1, rtol=1e-9, atol=1e-12, method=method)
    assert run.status == Status.DONE
    np.testing.assert_allclose(run.u, solution.y[:12].T, rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.w, solution.y[12:].T, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(run.v, run.w)


def test_without_coupling_every_oscillator_is_on_its_own():
    # Shifting the ring's state shifts its solution, and one oscillator does not see the others.
    model = NetworkedFHN(n_nodes=9, half_degree=3, sigma=0.0)
    u0, v0 = np.random.default_rng(2).uniform(-1, 1, (2, 9))
    run = simulate(model, u0=u0, v0=v0, t_end=2.0, t_step=0.1, rtol=1e-9, atol=1e-12)
    other = simulate(
        model,
        u0=np.where(np.arange(9) == 4, u0, -u0),
        v0=v0,
        t_end=2.0,
        t_step=0.1,
        rtol=1e-9,
        atol=1e-12,
    )
    np.testing.assert_allclose(run.u[:, 4], other.u[:, 4], atol=1e-8)
    assert np.abs(run.u[:, 3] - other.u[:, 3]).max() > 0.1


def test_defaults_are_the_paper_s():
    model = NetworkedFHN()
    assert (model.n_nodes, model.half_degree) == (500, 165)
    assert (model.epsilon, model.b, model.phi) == (0.05, 0.5, math.pi / 2 - 0.1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"half_degree": 5}, "P = 5 on a ring of 10 nodes: 1 <= P and 2 P < n_nodes are needed"),
        ({"half_degree": 0}, "P = 0 on a ring of 10 nodes: 1 <= P and 2 P < n_nodes are needed"),
        ({"epsilon": 0.0}, "epsilon = 0.0: must be above 0"),
        ({"epsilon": math.nan}, "epsilon = nan: must be above 0"),
    ],
)
def test_what_is_not_possible_is_refused_in_one_line(wrong, message):
    with pytest.raises(BadInput) as caught:
        NetworkedFHN(**{"n_nodes": 10, "half_degree": 3, **wrong})
    assert str(caught.value) == message


def test_only_the_origin_is_a_known_centre():
    model = NetworkedFHN(10, 3)
    assert model.equilibrium("origin") == (0.0, 0.0)
    with pytest.raises(BadInput, match=r'integrator\.centre = "upper"'):
        model.equilibrium("upper")


def test_lanes_are_shared_by_equal_rings_only():
    model = NetworkedFHN(10, 3)
    assert replace(model, sigma=0.7, epsilon=1.0).lane_group == model.lane_group
    groups = {model.lane_group, NetworkedFHN(11, 3).lane_group, NetworkedFHN(10, 4).lane_group}
    assert len(groups) == 3
