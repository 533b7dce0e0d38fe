"""`OwnModel` on a network and in a notebook: what the right-hand side gets, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_tools import run_all
from networks_for_tests import random_complex
from scipy.linalg import expm

from chimera_hpc import Network, OwnModel, Parameter, simulate
from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.simd import LANES


def diffusion(y, dy, p, ints, network):
    """Diffusion from each node to its neighbours, ``ints[1]`` times."""
    for lane in range(y.shape[1]):
        for i in range(ints[0]):
            pull = 0.0
            for e in range(network.indptr[i], network.indptr[i + 1]):
                j = network.indices[e]
                pull += network.weights[e] * (y[j, lane] - y[i, lane])
            dy[i, lane] = p[0, lane] * ints[1] * pull


def turning(y, dy, p, ints):
    """Two variables of each node that turn around the origin."""
    n = ints[0]
    for lane in range(y.shape[1]):
        for i in range(n):
            dy[i, lane] = -p[0, lane] * y[n + i, lane]
            dy[n + i, lane] = p[0, lane] * y[i, lane]


RATE = Parameter("rate", float, 0.2, "Rate.", above=0)
TIMES = Parameter("times", int, 1, "Factor.", low=1)
SPREADING = OwnModel(diffusion, variables=("x",), parameters=(RATE, TIMES), network=True)
TURNING = OwnModel(
    turning, variables=("x", "y"), parameters=(Parameter("omega", float, None, "Frequency."),)
)
ARROWS = Network(
    4, np.array([[0, 1], [1, 2], [3, 2]]), weights=np.array([0.5, 2, 1]), directed=True
)


@pytest.mark.parametrize("network", [random_complex(0), ARROWS], ids=["weighted", "directed"])
def test_right_hand_side_gets_the_links(network):
    a = network.adjacency.toarray()
    start = np.arange(float(network.n_nodes))
    run = simulate(
        SPREADING,
        network=network,
        parameters={"rate": 0.1, "times": 3},
        u0=start,
        t_end=2.0,
        t_step=1.0,
        rtol=1e-10,
        atol=1e-12,
    )
    exact = expm(0.3 * 2.0 * (a - np.diag(a.sum(axis=1)))) @ start
    np.testing.assert_allclose(run.u[-1], exact, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(run.w, run.u)


def test_lanes_share_the_network_and_have_the_bits_of_runs_alone():
    network = random_complex(1)
    rows = [{"rate": 0.1 * (lane + 1), "times": 2} for lane in range(LANES)]
    models = [SPREADING.point(row, network.n_nodes, network=network) for row in rows]
    assert all(model.int_params is models[0].int_params for model in models)
    assert len({model.lane_group for model in models}) == 1
    other = SPREADING.point(rows[0], network.n_nodes, network=random_complex(2))
    assert other.lane_group != models[0].lane_group
    states = list(np.random.default_rng(0).normal(size=(LANES, network.n_nodes)))
    control = Control(3.0, 0.0, 0.5)
    together, alone = (run_all(models, states, control, lanes=lanes) for lanes in (LANES, 1))
    assert [run.bits for run in together] == [run.bits for run in alone]


def test_model_without_a_network_runs_in_a_notebook():
    run = simulate(
        TURNING,
        parameters={"omega": 2, "n_nodes": 3},
        u0=[1, 0, 2],
        v0=[[0, 1, 0]],
        t_end=1.0,
        t_step=0.5,
        rtol=1e-9,
        atol=1e-12,
    )
    z = np.array([1, 1j, 2]) * np.exp(2j * run.t)[:, None]
    np.testing.assert_allclose(run.u, z.real, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.w, z.imag, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(run.v, run.w)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "a network is needed, as the model has network=True"),
        ({"network": ARROWS, "parameters": {"rat": 1.0}}, "'rat' is none of rate, times, n_nodes"),
        (
            {"network": ARROWS, "parameters": {"rate": "fast"}},
            "rate: 'fast' is not a finite number",
        ),
        ({"network": ARROWS, "parameters": {"times": 1.5}}, "times: 1.5 is not an integer from 1"),
        ({"network": ARROWS, "u0": np.zeros(3)}, r"u0 has shape \(3,\): needed is \(4,\)"),
    ],
)
def test_wrong_calls_are_refused(given, words):
    with pytest.raises(BadInput, match=words):
        simulate(SPREADING, **{"u0": np.zeros(4)} | given)


def test_what_does_not_belong_to_the_model_is_refused():
    start = {"u0": np.zeros(50), "v0": np.zeros(50)}
    with pytest.raises(BadInput, match="the model gets no network without OwnModel"):
        simulate(TURNING, network=ARROWS, parameters={"omega": 1.0}, **start)
    with pytest.raises(BadInput, match="omega is needed, it has no default"):
        simulate(TURNING, **start)
    with pytest.raises(BadInput, match="network and parameters belong to an OwnModel"):
        simulate(Network.ring(4, 1), parameters={"b": 1.0}, u0=np.zeros(4), v0=np.zeros(4))


def test_words_as_parameters_are_refused_at_once_with_what_to_use_instead():
    rule: type = str
    with pytest.raises(BadInput, match=r'of kind str, .* Parameter\("rule", int, 0, .* one model'):
        OwnModel(turning, variables=("x",), parameters=(Parameter("rule", rule, 0, "Rule."),))


def test_right_hand_side_without_the_network_is_refused():
    with pytest.raises(BadInput, match=r"where \(y, dy, p, ints, network\) is needed"):
        OwnModel(turning, variables=("x",), network=True)


def test_error_in_a_right_hand_side_on_a_network_is_one_line():
    def wrong(y, dy, p, ints, network):
        dy[0, 0] = network.degree[0]

    with pytest.raises(BadInput, match=r"right_hand_side does not compile: TypingError: .*degree"):
        _ = OwnModel(wrong, variables=("x",), network=True).compiled
