"""The topological model on any network and order: both forms, gauges, ring's sums."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from kernel_tools import run_all
from networks_for_tests import SIGNALS, complete, random_complex, slope, slopes

from chimera_hpc import Network, simulate
from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.topological_fhn import TopologicalFHN

NUMBERS = {"epsilon": 0.07, "b": 0.4, "c": -0.03}
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
orders = pytest.mark.parametrize("k", [0, 1, 2], ids=SIGNALS)


def start(network, k, seed=0):
    """Random u0 and v0 for u on the simplices of dimension k."""
    rng = np.random.default_rng(seed)
    n, second = network.dirac(k).shape
    return {"u0": rng.uniform(-1, 1, n), "v0": rng.uniform(-1, 1, second), "signals": SIGNALS[k]}


@orders
@pytest.mark.parametrize("seed", range(20))
def test_reduced_and_full_slopes_are_those_of_dense_matrices(seed, k):
    network = random_complex(seed)
    given = start(network, k, seed)
    u, v = given["u0"], given["v0"]
    d, _ = naive.dirac(network, k)
    expected = naive.simplicial_fhn_rhs(np.concatenate([u, v]), d, **NUMBERS)
    reduced, full = (
        TopologicalFHN(network, **NUMBERS, form=form, signals=SIGNALS[k])
        for form in ("reduced", "full")
    )
    dy = slope(full, full.state(u, v))
    np.testing.assert_allclose(dy, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    projected = np.concatenate([expected[: len(u)], d @ expected[len(u) :]])
    dy = slope(reduced, reduced.state(u, v))
    np.testing.assert_allclose(dy, projected, rtol=0, atol=1e-13 * np.abs(projected).max())


@orders
@pytest.mark.parametrize("seed", range(20))
def test_both_forms_give_the_same_trajectories(seed, k):
    network = random_complex(seed, n=9, chance=0.6)
    given = start(network, k, seed) | NUMBERS | TIGHT | {"t_end": 2.0, "t_step": 0.5}
    reduced, full = (simulate(network, **given, form=form) for form in ("reduced", "full"))
    assert full.v.shape == (5, len(given["v0"]))
    for name in ("u", "w", "v"):
        np.testing.assert_allclose(
            getattr(reduced, name), getattr(full, name), rtol=0, atol=1e-8, err_msg=name
        )


def test_linear_signals_lie_on_both_sides_of_the_links():
    network = random_complex(3)
    run = simulate(network, **start(network, 1), t_end=0.1, t_step=0.1)
    assert run.u.shape == (2, network.n_links)
    assert run.v.shape == (2, network.n_nodes + network.n_triangles)


@pytest.mark.parametrize("half", [1, 4, 9])
def test_ring_as_a_list_of_links_has_the_bits_of_the_ring(half):
    ring = Network.ring(20, half).reorient_node(0, half)
    edges = Network(20, ring.links)
    assert edges.half_degree == 0
    assert TopologicalFHN(ring).lane_group == TopologicalFHN(edges).lane_group
    given = start(ring, 0) | {"t_end": 20.0}
    own, listed = (simulate(network, **given) for network in (ring, edges))
    assert listed.u.tobytes() == own.u.tobytes()
    np.testing.assert_allclose(listed.v, own.v, rtol=0, atol=1e-9)
    shuffled = Network(20, np.random.default_rng(0).permutation(ring.links))
    assert TopologicalFHN(shuffled).reach == half


@pytest.mark.parametrize("half", [1, 4])
def test_relabelled_ring_has_the_slopes_of_the_ring(half):
    ring = Network.ring(20, half).reorient_node(0, half)
    new = np.random.default_rng(1).permutation(20)
    models = TopologicalFHN(ring), TopologicalFHN(ring.relabel(new))
    kernels = [model.kernel for model in models]
    assert kernels == ["sliding sums", f"sparse rows, {20 * 2 * half} entries"]
    u, w = np.random.default_rng(2).uniform(-1, 1, (2, 20))
    moved = np.empty((2, 20))
    moved[:, new] = u, w
    expected = slope(models[0], np.concatenate([u, w])).reshape(2, 20)
    found = slope(models[1], moved.ravel()).reshape(2, 20)[:, new]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("change", ["a link more", "a longer link", "a weight"])
def test_what_is_nearly_a_ring_is_none(change):
    links = Network.ring(9, 2).links.copy()
    weights = np.where(np.arange(18) == 3, 1.5, 1.0) if change == "a weight" else None
    if change == "a link more":
        links = np.vstack([links, [0, 4]])
    if change == "a longer link":
        links[0] = 0, 4
    assert TopologicalFHN(Network(9, links, weights=weights)).reach == 0


# --- invariants and gauges ------------------------------------------------------------------------


def test_triangles_do_not_reach_the_nodes():
    network = random_complex(1)
    bare = network.with_triangles("none")
    given = start(network, 0) | {"t_end": 5.0}
    assert simulate(network, **given).u.tobytes() == simulate(bare, **given).u.tobytes()
    links = simulate(network, **start(network, 1), t_end=5.0).u
    filled = start(network, 1)
    filled["v0"] = filled["v0"][: network.n_nodes]
    assert np.abs(simulate(bare, **filled, t_end=5.0).u - links).max() > 0.1


def test_turning_links_changes_the_signs_of_their_signals_and_nothing_else():
    network = random_complex(2)
    turned = np.array([0, 3, 4, 7])
    signs = np.ones(network.n_links)
    signs[turned] = -1.0
    given = start(network, 1) | {"t_end": 5.0}
    run = simulate(network, **given)
    given["u0"] = signs * given["u0"]
    other = simulate(network.reorient(turned), **given)
    np.testing.assert_array_equal(other.u, signs * run.u)
    np.testing.assert_allclose(other.v, run.v, rtol=0, atol=1e-9)


def test_without_b_the_orientation_has_no_effect_on_nodes():
    network = random_complex(2)
    other = network.reorient(np.array([1, 5, 6]))
    rng = np.random.default_rng(0)
    u0, v0 = rng.uniform(-1, 1, network.n_nodes), rng.uniform(-1, 1, network.n_links)
    turned = np.where(np.isin(np.arange(network.n_links), [1, 5, 6]), -v0, v0)
    runs = [simulate(network, u0=u0, v0=v0, b=0.0, t_end=5.0)]
    runs.append(simulate(other, u0=u0, v0=turned, b=0.0, t_end=5.0))
    np.testing.assert_allclose(runs[0].u, runs[1].u, rtol=0, atol=1e-11)


@orders
def test_part_of_w_in_the_kernel_of_the_laplacian_stays_zero(k):
    # Hollow, so that links and triangles have harmonic signals.
    network = random_complex(5, n=10, chance=0.5)
    network = network.with_triangles(network.triangles[::2])
    values, vectors = np.linalg.eigh(network.laplacian(k).toarray())
    kernel = vectors[:, values < 1e-9]
    run = simulate(network, **start(network, k), t_end=50.0)
    assert run.w.std() > 0.05
    assert k > 0 or kernel.shape[1] == 1
    assert np.abs(run.w @ kernel).max(initial=0.0) < 1e-9


# --- lanes ----------------------------------------------------------------------------------------


@orders
@pytest.mark.parametrize("form", ["reduced", "full"])
def test_lanes_have_the_bits_of_runs_alone(form, k):
    network = random_complex(4)
    models = [
        TopologicalFHN(network, b=0.1 * lane, form=form, signals=SIGNALS[k])
        for lane in range(LANES)
    ]
    given = [start(network, k, seed) for seed in range(LANES)]
    states = [model.state(one["u0"], one["v0"]) for model, one in zip(models, given, strict=True)]
    control = Control(5.0, 0.0, 0.5)
    together, alone = (run_all(models, states, control, lanes=lanes) for lanes in (LANES, 1))
    assert [run.bits for run in together] == [run.bits for run in alone]


def test_orientations_of_the_nodes_links_share_a_call():
    network = random_complex(4)
    other = network.reorient(np.array([0, 2]))
    assert TopologicalFHN(network).lane_group == TopologicalFHN(other).lane_group
    assert (
        TopologicalFHN(network, signals="links").lane_group
        != TopologicalFHN(other, signals="links").lane_group
    )
    assert TopologicalFHN(network).lane_group != TopologicalFHN(random_complex(5)).lane_group


# --- equal rows -----------------------------------------------------------------------------------


def test_complete_graph_multiplies_one_row():
    network = complete(24)
    model = TopologicalFHN(network, **NUMBERS)
    assert model.kernel == "1 shared rows, 24 entries"
    state = np.random.default_rng(0).uniform(-1, 1, 48)
    u, w = state[:24], state[24:]
    s, total = naive.incidence(24, network.links).sum(axis=1), u.sum()
    expected = [(u - u**3 / 3 - w) / 0.07, 0.4 * s - 0.03 * w + 24 * u - total]
    np.testing.assert_allclose(slope(model, state), np.concatenate(expected), rtol=0, atol=1e-11)
    together = slopes([model] * LANES, np.repeat(state[:, None], LANES, axis=1))
    np.testing.assert_array_equal(together, np.repeat(slope(model, state)[:, None], LANES, axis=1))


# --- refusals -------------------------------------------------------------------------------------


def test_directed_network_is_refused_with_the_reason():
    network = Network(3, np.array([[0, 1], [1, 2]]), directed=True)
    with pytest.raises(BadInput, match="a directed network has no boundary matrices"):
        TopologicalFHN(network)


def test_signals_that_a_network_has_not_are_refused():
    with pytest.raises(BadInput, match='signals = "triangles": the network has none'):
        simulate(Network.ring(8, 1), u0=[], v0=[], signals="triangles")
    with pytest.raises(BadInput, match='signals = \'faces\': allowed are "nodes", "links"'):
        simulate(Network.ring(8, 1), u0=[], v0=[], signals="faces")


def test_state_of_another_size_is_refused():
    network = random_complex(0)
    given = start(network, 1)
    with pytest.raises(BadInput, match=rf"v0 has shape \(3,\): needed is \({len(given['v0'])},\)"):
        simulate(network, **given | {"v0": np.zeros(3)})


def test_only_nodes_have_homogeneous_equilibria():
    model = TopologicalFHN(random_complex(0), signals="links")
    assert model.equilibrium("origin") == (0.0, 0.0)
    with pytest.raises(BadInput, match='links have "origin" only'):
        model.equilibrium("upper")
