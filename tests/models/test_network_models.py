"""Models of oscillators on any network against slow twins with dense matrices; their lanes."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import naive
import numpy as np
import pytest
from kernel_tools import run_all
from networks_for_tests import complete, random_complex, slope, two_populations

from chimera_hpc import (
    KuramotoSakaguchi,
    Network,
    NetworkedFHN,
    NetworkFHN,
    SimplicialKuramoto,
    StuartLandau,
    natural_frequencies,
    simulate,
)
from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.simd import LANES

TESTS = Path(__file__).parents[1]
DIRECTED = Network(
    6, np.array([[0, 1], [1, 2], [2, 0], [3, 2], [4, 3], [5, 4], [0, 5]]), directed=True
)
NETWORKS = {
    "weighted": random_complex(0),
    "directed": DIRECTED,
    "negative": DIRECTED.with_weights(np.array([1.0, -0.5, 2.0, 0.3, 1.0, 0.7, 1.0])),
    "complete": complete(20),
    "two populations": two_populations(10, 0.2),
}
networks = pytest.mark.parametrize("network", NETWORKS.values(), ids=NETWORKS)


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-14 * max(1, np.abs(expected).max()))


@networks
def test_kuramoto_sakaguchi(network):
    rng = np.random.default_rng(1)
    theta, omega = rng.uniform(-20, 20, network.n_nodes), rng.normal(size=network.n_nodes)
    model = KuramotoSakaguchi(network, coupling=1.3, phase_lag=0.4, omega=omega)
    a = naive.dense_adjacency(network)
    close(slope(model, theta), naive.kuramoto_sakaguchi_rhs(theta, a, 1.3, 0.4, omega))


@networks
def test_stuart_landau(network):
    rng = np.random.default_rng(2)
    n = network.n_nodes
    state, omega = rng.normal(size=2 * n), rng.normal(size=n)
    model = StuartLandau(network, 0.3, phase_lag=0.2, growth=1.1, omega=omega, shear=0.7)
    z = state[:n] + 1j * state[n:]
    a = naive.dense_adjacency(network)
    expected = naive.stuart_landau_rhs(z, a, 0.3, 0.2, 1.1, omega, 0.7)
    close(slope(model, state), np.concatenate([expected.real, expected.imag]))


@pytest.mark.slow
@networks
def test_networked_fhn(network):
    n = network.n_nodes
    x, y = np.random.default_rng(3).normal(size=(2, n))
    model = NetworkFHN(network, sigma=0.3, epsilon=0.06, b=0.4, phi=1.2)
    a = naive.dense_adjacency(network)
    expected = naive.network_fhn_rhs(x, y, a, 0.3, 0.06, 0.4, 1.2)
    close(slope(model, np.concatenate([x, y])), np.concatenate(expected))


def test_networked_fhn_on_a_ring_is_the_ring_model():
    ring = Network.ring(20, 6)
    state = np.random.default_rng(0).uniform(-2, 2, 40)
    close(slope(NetworkFHN(ring), state), slope(NetworkedFHN(20, 6), state))


@pytest.mark.parametrize(("order", "explosive"), [(0, False), (1, False), (2, False), (1, True)])
def test_simplicial_kuramoto(order, explosive):
    network = random_complex(1, weighted=False)
    d, lower = naive.dirac(network, order)
    rng = np.random.default_rng(4)
    theta, omega = rng.uniform(-9, 9, len(d)), rng.normal(size=len(d))
    model = SimplicialKuramoto(network, order, 1.3, omega, explosive)
    expected = naive.simplicial_kuramoto_rhs(theta, d, lower, 1.3, omega, explosive)
    close(slope(model, theta), expected)
    # What is computed in the work space is the same the second time.
    assert slope(model, theta).tobytes() == slope(model, theta).tobytes()


def test_simplicial_kuramoto_on_nodes_is_kuramoto():
    network = random_complex(1, weighted=False)
    theta = np.random.default_rng(0).uniform(-9, 9, network.n_nodes)
    close(
        slope(SimplicialKuramoto(network, 0, coupling=0.7), theta),
        slope(KuramotoSakaguchi(network, coupling=0.7), theta),
    )


PLAIN, SHARING = NETWORKS["weighted"], NETWORKS["two populations"]
HOLLOW = random_complex(1, weighted=False)


@pytest.mark.parametrize(
    ("model", "n_shared"),
    [
        (KuramotoSakaguchi(PLAIN, phase_lag=0.3), 0),
        (KuramotoSakaguchi(SHARING, phase_lag=0.3), 2),
        (StuartLandau(PLAIN), 0),
        (StuartLandau(SHARING), 2),
        (NetworkFHN(PLAIN), 0),
        (NetworkFHN(SHARING), 2),
        (SimplicialKuramoto(HOLLOW), 0),
        (SimplicialKuramoto(HOLLOW, explosive=True), 0),
    ],
)
def test_lanes_have_the_bits_of_runs_alone(model, n_shared):
    assert model.packed.n_shared == n_shared
    parameter = "sigma" if isinstance(model, NetworkFHN) else "coupling"
    models = [replace(model, **{parameter: 0.1 * (lane + 1)}) for lane in range(LANES)]
    assert len({one.lane_group for one in models}) == 1
    rng = np.random.default_rng(0)
    states = [rng.uniform(-2, 2, model.n_rows) for _ in range(LANES)]
    control = Control(4.0, 0.0, 0.5)
    together, alone = (run_all(models, states, control, lanes=lanes) for lanes in (LANES, 1))
    assert [run.bits for run in together] == [run.bits for run in alone]


# --- what simulate returns ------------------------------------------------------------------------


def test_phases_are_not_wrapped_and_u_is_their_cosine():
    model = KuramotoSakaguchi(complete(5), coupling=0.0, omega=[1.0, 2.0, 3.0, -4.0, 0.0])
    start = np.arange(5.0)
    run = simulate(model, phase0=start, t_end=20.0, t_step=0.5)
    np.testing.assert_allclose(run.phase, start + run.t[:, None] * model.omega, atol=1e-10)
    np.testing.assert_allclose(run.u, np.cos(run.phase), rtol=0, atol=1e-15)
    np.testing.assert_allclose(run.w, np.sin(run.phase), rtol=0, atol=1e-15)
    assert run.v.shape == (41, 0)


def test_oscillators_without_coupling_have_the_known_cycle():
    # |z|^2 tends to lambda, and the frequency to omega - gamma lambda.
    model = StuartLandau(complete(4), coupling=0.0, growth=0.25, omega=2.0, shear=3.0)
    run = simulate(
        model, u0=np.full(4, 0.5), v0=np.zeros(4), t_end=10.0, t_step=0.01, rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(
        run.u, np.repeat(0.5 * np.cos(1.25 * run.t)[:, None], 4, 1), atol=1e-7
    )
    np.testing.assert_allclose(
        run.w, np.repeat(0.5 * np.sin(1.25 * run.t)[:, None], 4, 1), atol=1e-7
    )
    np.testing.assert_array_equal(run.v, run.w)


def test_mean_frequency_of_an_undirected_network_without_lag_is_kept():
    network = random_complex(2)
    omega = natural_frequencies(network.n_nodes, "lorentzian", width=0.3, seed=1)
    run = simulate(
        KuramotoSakaguchi(network, coupling=0.4, omega=omega),
        phase0=np.zeros(network.n_nodes),
        t_end=20.0,
        t_step=1.0,
        rtol=1e-8,
        atol=1e-10,
    )
    np.testing.assert_allclose(run.phase.mean(axis=1), omega.mean() * run.t, rtol=0, atol=1e-7)


def test_solution_outlives_the_next_one():
    model = KuramotoSakaguchi(complete(5), omega=natural_frequencies(5, "normal"))
    run = simulate(model, phase0=np.zeros(5), t_end=2.0)
    before = run.phase.copy()
    simulate(model, phase0=np.ones(5), t_end=2.0)
    np.testing.assert_array_equal(run.phase, before)


# --- frequencies ----------------------------------------------------------------------------------


def test_frequencies():
    assert natural_frequencies(3, centre=2.0).tolist() == [2.0, 2.0, 2.0]
    normal = natural_frequencies(20_000, "normal", 1.0, 0.5, seed=3)
    assert (abs(normal.mean() - 1.0), abs(normal.std() - 0.5)) < (0.02, 0.02)
    lorentzian = natural_frequencies(20_000, "lorentzian", 1.0, 0.5, seed=3)
    quartiles = np.quantile(lorentzian, [0.25, 0.5, 0.75])
    np.testing.assert_allclose(quartiles, [0.5, 1.0, 1.5], atol=0.03)
    np.testing.assert_array_equal(lorentzian, natural_frequencies(20_000, "lorentzian", 1, 0.5, 3))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "gauss"}, "kind = 'gauss': allowed are identical, normal, lorentzian"),
        ({"kind": "normal", "width": -1.0}, "width = -1.0: finite numbers and width >= 0"),
        ({"centre": math.nan}, "centre = nan"),
    ],
)
def test_wrong_frequencies_are_refused(given, words):
    with pytest.raises(BadInput, match=words):
        natural_frequencies(3, **given)


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: KuramotoSakaguchi(complete(4), coupling=math.inf), "coupling = inf: a finite"),
        (lambda: KuramotoSakaguchi(complete(4), omega=[1.0]), r"omega has shape \(1,\): needed is"),
        (
            lambda: StuartLandau(complete(4), omega=[math.nan] * 4),
            "omega holds values that are not",
        ),
        (lambda: NetworkFHN(complete(4), epsilon=0.0), "epsilon = 0.0: must be above 0"),
        (lambda: NetworkFHN(Network(3, np.array([[0, 1]]))), "node 2 has no links"),
        (lambda: SimplicialKuramoto(complete(4), order=3), "order = 3: allowed are 0"),
        (
            lambda: SimplicialKuramoto(complete(4), order=2),
            "the network has no triangles",
        ),
        (lambda: SimplicialKuramoto(random_complex(0)), "simplicial_kuramoto knows no weights"),
        (lambda: SimplicialKuramoto(complete(4), explosive=True), "with_triangles adds triangles"),
        (lambda: SimplicialKuramoto(DIRECTED), "a directed network has no orientation"),
    ],
)
def test_wrong_numbers_and_networks_are_refused(make, words):
    with pytest.raises(BadInput, match=words):
        make()


def test_start_of_another_kind_is_refused():
    phases, planar = KuramotoSakaguchi(complete(4)), StuartLandau(complete(4))
    with pytest.raises(BadInput, match="kuramoto_sakaguchi: phase0 is needed, and neither"):
        simulate(phases, u0=np.zeros(4))
    with pytest.raises(BadInput, match="stuart_landau has no phases: give u0 and v0"):
        simulate(planar, phase0=np.zeros(4))
    with pytest.raises(BadInput, match=r"stuart_landau: u0 of shape \(4,\) and v0 of shape \(4,\)"):
        simulate(planar, u0=np.zeros(4))
    with pytest.raises(BadInput, match=r"phase0 has shape \(3,\): needed is \(4,\)"):
        simulate(phases, phase0=np.zeros(3))
    with pytest.raises(
        BadInput, match="a Network, a model or an OwnModel is needed, not 'kuramoto"
    ):
        simulate("kuramoto_sakaguchi", phase0=np.zeros(3))
    with pytest.raises(AttributeError, match="stuart_landau has no phases"):
        _ = simulate(planar, u0=np.zeros(4), v0=np.zeros(4), t_end=0.1).phase


# --- without compilation --------------------------------------------------------------------------

SLOPES = """
import numpy as np
from networks_for_tests import complete, random_complex, slopes
from chimera_hpc import *

network, plain = random_complex(1, n=11), random_complex(1, n=8, weighted=False)
models = [
    TopologicalFHN(plain),
    TopologicalFHN(network, signals="links"),
    TopologicalFHN(network, signals="links", form="full"),
    TopologicalFHN(complete(16)),
    KuramotoSakaguchi(network, 0.5, 0.3),
    StuartLandau(complete(16), 0.1, 0.2),
    NetworkFHN(plain),
    SimplicialKuramoto(plain, explosive=True),
]
for model in models:
    states = np.random.default_rng(0).uniform(-3, 3, (model.n_rows, 8))
    found = slopes([model] * 8, states)
    assert slopes([model], states[:, 2:3]).tobytes() == found[:, 2:3].tobytes()
    print(found.sum(axis=0).tobytes().hex(), found[0].tobytes().hex())
"""


@pytest.mark.slow
def test_plain_python_gives_the_same_bits():
    said = []
    for disabled in ("0", "1"):
        environment = os.environ | {"NUMBA_DISABLE_JIT": disabled}
        environment["PYTHONPATH"] = os.pathsep.join(map(str, (TESTS.parent, TESTS)))
        command = [sys.executable, "-c", SLOPES]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        said.append(done.stdout.split())
    assert len(said[0]) == 16
    assert said[0] == said[1]
