"""Rings against the drawings, link by link, and their matrices against dense ones."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network.network import Network
from chimera_hpc.network.topology import Topology

# The paper's drawings of N0 = 8, P = 3 (nodes counted from 1, as there): every link as it is drawn.
CLOCKWISE = """
1>2 1>3 1>4  2>3 2>4 2>5  3>4 3>5 3>6  4>5 4>6 4>7
5>6 5>7 5>8  6>7 6>8 6>1  7>8 7>1 7>2  8>1 8>2 8>3
"""
ONE_REORIENTED = """
2>1 1>3 1>4  2>3 2>4 2>5  3>4 3>5 3>6  4>5 4>6 4>7
5>6 5>7 5>8  6>7 6>8 6>1  7>8 7>1 7>2  1>8 8>2 8>3
"""
ALL_REORIENTED = """
2>1 3>1 4>1  2>3 2>4 2>5  3>4 3>5 3>6  4>5 4>6 4>7
5>6 5>7 5>8  6>7 6>8 1>6  7>8 1>7 7>2  1>8 8>2 8>3
"""
UPWARDS = """
1>2 1>3 1>4  2>3 2>4 2>5  3>4 3>5 3>6  4>5 4>6 4>7
5>6 5>7 5>8  6>7 6>8 1>6  7>8 1>7 2>7  1>8 2>8 3>8
"""


def drawn(text):
    return [[int(node) - 1 for node in link.split(">")] for link in text.split()]


@st.composite
def rings(draw):
    """A ring with any orientation, reoriented around a node and at random."""
    n = draw(st.integers(3, 21))
    half = draw(st.integers(1, (n - 1) // 2))
    topology = Topology.ring(n, half, draw(st.sampled_from([1, 2])))
    topology = topology.reorient_node(draw(st.integers(0, n - 1)), draw(st.integers(0, half)))
    return topology.reorient_random(draw(st.integers(0, n * half)), draw(st.integers(0, 99)))


@pytest.mark.parametrize(
    ("topology", "links"),
    [
        (Topology.ring(8, 3), CLOCKWISE),
        (Topology.ring(8, 3).reorient_node(0, 1), ONE_REORIENTED),
        (Topology.ring(8, 3).reorient_node(0, 3), ALL_REORIENTED),
        (Topology.ring(8, 3, orientation=2), UPWARDS),
    ],
    ids=["Q = 0", "Q = 1", "Q = 3", "orientation 2"],
)
def test_ring_equals_the_drawing_link_by_link(topology, links):
    assert topology.links.tolist() == drawn(links)
    assert topology.n_links == 24


@pytest.mark.parametrize("orientation", [1, 2])
@pytest.mark.parametrize(("n", "half"), [(3, 1), (9, 4), (10, 4), (50, 24), (51, 25)])
def test_rings_of_any_size(n, half, orientation):
    topology = Topology.ring(n, half, orientation)
    assert [tuple(link) for link in topology.links] == naive.ring_links(n, half, orientation)
    # Every pair at distance 1..P once, no other, no loop.
    pairs = {frozenset(link) for link in topology.links.tolist()}
    assert len(pairs) == topology.n_links == n * half
    assert all(1 <= min(abs(a - b), n - abs(a - b)) <= half for a, b in topology.links)


def test_divergence_of_a_reoriented_node():
    # s = -2 on nodes 2..Q+1, +2 on nodes N0-Q+1..N0, 0 elsewhere, node 1 included.
    for count in range(13):
        expected = np.zeros(50)
        expected[1 : count + 1] = -2.0
        expected[50 - count :] = 2.0
        s = Topology.ring(50, 12).reorient_node(0, count).divergence
        np.testing.assert_array_equal(s, expected)
        np.testing.assert_array_equal(s, -np.roll(s[::-1], 1))  # odd about node 1


@given(rings())
def test_matrices_equal_the_dense_ones(topology):
    matrix = naive.incidence(topology.n_nodes, topology.links)
    np.testing.assert_array_equal(topology.incidence.toarray(), matrix)
    np.testing.assert_array_equal(topology.divergence, matrix.sum(axis=1))
    u, v = np.arange(topology.n_nodes) ** 2.0, np.arange(topology.n_links) ** 2.0
    np.testing.assert_array_equal(topology.gather_links(v), matrix @ v)
    np.testing.assert_array_equal(topology.spread_to_links(u), matrix.T @ u)
    tails = np.repeat(np.arange(topology.n_nodes), topology.half_degree)
    np.testing.assert_array_equal(topology.link_signs, -matrix[tails, np.arange(len(tails))])


@given(rings())
def test_laplacian_equals_the_dense_one(topology):
    matrix = naive.incidence(topology.n_nodes, topology.links)
    laplacian = matrix @ matrix.T
    eigenvalues = np.sort(topology.laplacian_eigenvalues)
    np.testing.assert_allclose(eigenvalues, np.linalg.eigvalsh(laplacian), atol=1e-11)
    modes = np.exp(2j * np.pi * np.outer(*[np.arange(topology.n_nodes)] * 2) / topology.n_nodes)
    np.testing.assert_allclose(
        laplacian @ modes, modes * topology.laplacian_eigenvalues, atol=1e-10
    )
    for shape in [(topology.n_nodes,), (topology.n_nodes, 3)]:
        w = np.random.default_rng(0).normal(size=shape)
        expected = np.linalg.pinv(laplacian) @ w
        np.testing.assert_allclose(topology.solve_laplacian(w), expected, atol=1e-11)


@given(rings())
def test_cycle_part_is_the_projection_on_the_kernel(topology):
    matrix = naive.incidence(topology.n_nodes, topology.links)
    projection = np.eye(topology.n_links) - np.linalg.pinv(matrix) @ matrix
    v = np.random.default_rng(1).normal(size=topology.n_links)
    np.testing.assert_allclose(topology.cycle_part(v), projection @ v, atol=1e-11)
    np.testing.assert_allclose(matrix @ topology.cycle_part(v), 0.0, atol=1e-11)


@given(rings())
def test_reorienting_a_node_twice_gives_the_ring_back(topology):
    half = topology.half_degree
    node = topology.n_nodes // 2
    turned = topology.reorient_node(node, half)
    assert (turned.links != topology.links).any(axis=1).sum() == 2 * half
    assert (turned.links[:, 0] == topology.links[:, 1]).sum() >= 2 * half
    np.testing.assert_array_equal(turned.reorient_node(node, half).links, topology.links)


@given(st.integers(0, 48), st.integers(0, 2**32))
def test_random_links_are_different_and_reproducible(count, seed):
    ring = Topology.ring(16, 3)
    turned = ring.reorient_random(count, seed)
    changed = (turned.links != ring.links).any(axis=1)
    assert changed.sum() == count
    np.testing.assert_array_equal(turned.links[changed], ring.links[changed][:, ::-1])
    np.testing.assert_array_equal(turned.links, ring.reorient_random(count, seed).links)
    generator = np.random.default_rng(seed)
    np.testing.assert_array_equal(turned.links, ring.reorient_random(count, generator).links)


@given(rings())
def test_links_at_a_node_are_those_that_touch_it_nearest_first(topology):
    n, half = topology.n_nodes, topology.half_degree
    for node in (0, n // 2, n - 1):
        at = topology.links_at(node)
        touching = np.flatnonzero((topology.links == node).any(axis=1))
        assert sorted(at) == touching.tolist()
        ends = [set(link) - {node} for link in topology.links[at].tolist()]
        ahead = [{(node + k) % n} for k in range(1, half + 1)]
        behind = [{(node - k) % n} for k in range(1, half + 1)]
        assert ends == ahead + behind
        nearest = topology.links_at(node, 1)
        assert nearest.tolist() == [at[0], at[half]]


@given(st.integers(0, 6), st.integers(0, 2**32))
def test_random_links_may_be_drawn_from_some(count, seed):
    ring = Topology.ring(16, 3)
    among = ring.links_at(5)
    turned = ring.reorient_random(count, seed, among)
    changed = np.flatnonzero((turned.links != ring.links).any(axis=1))
    assert len(changed) == count
    assert set(changed) <= set(among)


def test_random_links_are_uniform():
    ring = Topology.ring(10, 2)
    turned = [
        (ring.reorient_random(5, seed).links != ring.links).any(axis=1) for seed in range(800)
    ]
    hits = np.sum(turned, axis=0)
    # 800 draws of 5 out of 20: mean 200, standard deviation 12.2
    assert np.abs(hits - 200).max() < 5 * 12.2
    assert len({row.tobytes() for row in turned}) > 700


@given(rings())
def test_reorienting_leaves_the_ring_it_started_from_alone(topology):
    before = topology.links.copy()
    s = topology.divergence.copy()
    turned = topology.reorient_node(0, topology.half_degree).reorient_random(topology.n_links)
    assert turned.divergence is not s
    np.testing.assert_array_equal(topology.links, before)
    np.testing.assert_array_equal(topology.divergence, s)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Topology.ring(8, 4), "P = 4 on a ring of 8 nodes: 1 <= P and 2 P < n_nodes"),
        (lambda: Topology.ring(9, 5), "P = 5 on a ring of 9 nodes"),
        (lambda: Topology.ring(8, 0), "P = 0 on a ring of 8 nodes"),
        (lambda: Topology.ring(8, -1), "P = -1 on a ring of 8 nodes"),
        (lambda: Topology.ring(8, 3, 0), "orientation = 0: allowed are 1 and 2"),
        (lambda: Topology.ring(8, 3, 3), "orientation = 3: allowed are 1 and 2"),
        (lambda: Topology.ring(8, 3).reorient_node(0, 4), "Q = 4: allowed is 0 to P = 3"),
        (lambda: Topology.ring(8, 3).reorient_node(0, -1), "Q = -1: allowed is 0 to P = 3"),
        (lambda: Topology.ring(8, 3).reorient_node(8, 1), "node = 8: allowed is 0 to 7"),
        (lambda: Topology.ring(8, 3).reorient_node(-1, 1), "node = -1: allowed is 0 to 7"),
        (lambda: Topology.ring(8, 3).reorient_random(25), "flips = 25: allowed is 0 to the 24"),
        (lambda: Topology.ring(8, 3).reorient_random(-1), "flips = -1: allowed is 0 to the 24"),
        (lambda: Topology.ring(8, 3).reorient_random(2.5), "flips = 2.5: allowed is 0 to the 24"),
        (lambda: Topology.ring(8, 3).reorient_random(2, -1), "seed = -1: a whole number from 0"),
        (lambda: Network.small_world(9, 2, 0.1, seed=0.5), "seed = 0.5: a whole number from 0"),
        (lambda: Network.scale_free(9, 2, seed=-3), "seed = -3: a whole number from 0"),
        (
            lambda: Topology.ring(8, 3).reorient_random(7, 0, Topology.ring(8, 3).links_at(0)),
            "flips = 7: allowed is 0 to the 6 links to draw from",
        ),
    ],
)
def test_what_is_not_possible_is_refused_in_one_line(make, message):
    with pytest.raises(BadInput) as caught:
        make()
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
