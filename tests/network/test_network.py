"""Networks: matrices against their definitions, relabelling, orientations and refused input."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from network_tools import boundaries, complexes, dense_dirac, random_complex, refusal

from chimera_hpc import Network, Topology

SQUARE = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)]


def equal(first: Network, second: Network) -> bool:
    return first.digest == second.digest


def test_topology_is_another_name_of_network() -> None:
    assert Topology is Network


@given(complexes(weights=False))
def test_boundaries_equal_their_definition(network: Network) -> None:
    b_1, b_2 = boundaries(network)
    np.testing.assert_array_equal(network.boundary(1).toarray(), b_1)
    np.testing.assert_array_equal(network.boundary(2).toarray(), b_2)
    np.testing.assert_array_equal(b_1 @ b_2, 0.0)
    np.testing.assert_array_equal(network.divergence, b_1.sum(axis=1))


@given(complexes(), st.sampled_from([0, 1, 2]))
def test_weighted_matrices_equal_their_definition(network: Network, k: int) -> None:
    dirac = dense_dirac(network, k)
    np.testing.assert_allclose(network.dirac(k).toarray(), dirac, atol=1e-15)
    laplacian = network.laplacian(k)
    np.testing.assert_allclose(laplacian.toarray(), dirac @ dirac.T, atol=1e-13)
    np.testing.assert_allclose(network.source(k), dirac.sum(axis=1), atol=1e-13)
    assert laplacian.has_sorted_indices
    assert (laplacian.data != 0.0).all()
    product = network.boundary(1) @ network.boundary(2)
    assert abs(product).max() < 1e-14 if product.nnz else True


@given(complexes())
def test_laplacian_of_nodes_is_degrees_minus_adjacency(network: Network) -> None:
    adjacency = network.adjacency.toarray()
    np.testing.assert_array_equal(adjacency, adjacency.T)
    expected = np.diag(adjacency.sum(axis=1)) - adjacency
    np.testing.assert_allclose(network.laplacian(0).toarray(), expected, atol=1e-13)


@given(complexes(), st.sampled_from([0, 1, 2]))
def test_pseudo_inverse_and_projection_equal_the_dense_ones(network: Network, k: int) -> None:
    dirac = dense_dirac(network, k)
    rng = np.random.default_rng(k)
    w, v = rng.normal(size=(len(dirac), 2)), rng.normal(size=dirac.shape[1])
    inverse = np.linalg.pinv(dirac @ dirac.T, rcond=1e-9)
    np.testing.assert_allclose(network.solve_laplacian(w, k), inverse @ w, atol=1e-9)
    projection = np.eye(dirac.shape[1]) - dirac.T @ inverse @ dirac
    np.testing.assert_allclose(network.cycle_part(v, k), projection @ v, atol=1e-9)


def test_a_large_laplacian_is_solved_without_a_dense_matrix() -> None:
    n = 2500
    path = Network(n, np.column_stack([np.arange(n - 1), np.arange(1, n)]))
    w = np.zeros(n)
    w[0], w[1] = 1.0, -1.0
    solved = path.solve_laplacian(w)
    np.testing.assert_allclose(path.laplacian(0) @ solved, w, atol=1e-9)
    assert abs(solved.mean()) < 1e-9


@given(complexes(), st.integers(0, 10**6))
def test_reorienting_changes_signs_only(network: Network, seed: int) -> None:
    count = network.n_links // 2
    turned = network.reorient_random(count, seed)
    signs = np.where((turned.links == network.links).all(axis=1), 1.0, -1.0)
    assert (signs < 0.0).sum() == count
    gauge = np.diag(signs)
    for k, frame in ((0, np.eye(network.n_nodes)), (1, gauge)):
        expected = frame @ network.laplacian(k).toarray() @ frame
        np.testing.assert_allclose(turned.laplacian(k).toarray(), expected, atol=1e-12)
    assert equal(turned.reorient(np.flatnonzero(signs < 0.0)), network)


@given(complexes(), st.randoms(use_true_random=False))
def test_relabelling_permutes_nodes_and_keeps_links_and_triangles(
    network: Network, random: Any
) -> None:
    new = np.array(random.sample(range(network.n_nodes), network.n_nodes))
    renamed = network.relabel(new)
    for k in (1, 2):
        np.testing.assert_array_equal(
            renamed.laplacian(k).toarray(), network.laplacian(k).toarray()
        )
    moved = renamed.laplacian(0).toarray()[np.ix_(new, new)]
    np.testing.assert_array_equal(moved, network.laplacian(0).toarray())
    assert equal(renamed.relabel(np.argsort(new)), network)


def test_order_and_groups_of_nodes_go_with_their_new_names() -> None:
    network = Network.ring(4, 1).with_order([3, 0, 1, 2]).with_groups([5, 6, 7, 8])
    renamed = network.relabel([1, 2, 3, 0])
    assert renamed.order.tolist() == [0, 1, 2, 3]
    assert renamed.groups is not None
    assert renamed.groups.tolist() == [8, 5, 6, 7]


def test_a_ring_is_the_same_network_as_its_list_of_links() -> None:
    ring = Network.ring(9, 3).reorient_node(0, 2)
    listed = Network(9, ring.links)
    assert (ring.half_degree, listed.half_degree) == (3, 0)
    assert equal(ring, listed)
    w = np.random.default_rng(0).normal(size=(9, 2))
    np.testing.assert_allclose(listed.solve_laplacian(w), ring.solve_laplacian(w), atol=1e-13)
    rising = np.sort(ring.laplacian_eigenvalues)
    np.testing.assert_allclose(listed.laplacian_eigenvalues, rising, atol=1e-13)
    assert set(listed.links_at(4)) == set(ring.links_at(4))
    # The sums of a ring's kernels know no weights.
    assert ring.with_weights(np.full(27, 2.0)).half_degree == 0
    assert ring.with_triangles("cliques").half_degree == 3


def test_cliques_are_all_triangles_of_links() -> None:
    assert Network.ring(50, 12).with_triangles("cliques").n_triangles == 3300
    square = Network(4, SQUARE).with_triangles("cliques")
    assert square.triangles is not None
    assert square.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert square.with_triangles("none").n_triangles == 0


@pytest.mark.parametrize(
    ("network", "expected"),
    [
        (Network(4, SQUARE), (1, 2, 0)),
        (Network(4, SQUARE).with_triangles("cliques"), (1, 0, 0)),
        (Network(4, SQUARE).with_triangles([[0, 1, 2]]), (1, 1, 0)),
        (Network(5, []), (5, 0, 0)),
        (random_complex(0, 4, 1.0).with_triangles("cliques"), (1, 0, 1)),  # a tetrahedron's surface
    ],
)
def test_betti_numbers(network: Network, expected: tuple[int, int, int]) -> None:
    assert network.betti == expected


def test_arrays_are_read_only_copies() -> None:
    links = np.array(SQUARE)
    network = Network(4, links, np.ones(5), [[0, 1, 2]])
    links[0] = 3, 2
    assert network.links[0].tolist() == [0, 1]
    for array in (network.links, network.weights, network.triangles):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError):
        network.n_nodes = 5  # type: ignore[misc]


def test_size_counts_simplices() -> None:
    network = Network(4, SQUARE, triangles=[[0, 1, 2]])
    assert [network.size(name) for name in ("nodes", "links", "triangles")] == [4, 5, 1]


def test_directed_networks_have_an_adjacency_only() -> None:
    network = Network(3, [(0, 1), (1, 0), (1, 2)], [1.0, 2.0, -3.0], directed=True)
    expected = [[0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, -3.0, 0.0]]
    np.testing.assert_array_equal(network.adjacency.toarray(), expected)


def test_neighbour_mean_divides_by_the_degree() -> None:
    network = Network(3, [(0, 1), (1, 2)], [1.0, 3.0])
    expected = [[0.0, 1.0, 0.0], [0.25, 0.0, 0.75], [0.0, 1.0, 0.0]]
    np.testing.assert_array_equal(network.neighbour_mean.toarray(), expected)


ARROW = Network(2, [(0, 1)], directed=True)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Network(0, []), "n_nodes = 0: allowed are whole numbers from 1"),
        (lambda: Network(2.5, []), "n_nodes = 2.5: allowed are whole numbers"),
        (lambda: Network(3, [(0, 1), (1, 3)]), "link 1 from node 1 to node 3: allowed are nodes 0"),
        (lambda: Network(3, [(0, 1), (-1, 2)]), "link 1 from node -1 to node 2: allowed are nodes"),
        (lambda: Network(3, [(0, 1), (1, 1)]), "link 1 from node 1 to node 1: a link joins two"),
        (
            lambda: Network(3, [(0, 1), (1, 0)]),
            "link 1 (nodes 1, 0) repeats link 0: give each link",
        ),
        (lambda: Network(3, [(0.5, 1)]), "links must be whole numbers of shape (n, 2)"),
        (lambda: Network(3, [(0, 1, 2)]), "links must be whole numbers of shape (n, 2)"),
        (lambda: Network(3, [("a", "b")]), "links must be whole numbers of shape (n, 2)"),
        (lambda: Network(3, [(0, float("nan"))]), "links must be whole numbers of shape (n, 2)"),
        (lambda: Network(2, [(0, 1)], [1.0, 2.0]), "weights have shape (2,): expected is (1,)"),
        (lambda: Network(2, [(0, 1)], [np.nan]), "the weight of link 0 is nan: weights must be"),
        (lambda: Network(2, [(0, 1)], [np.inf]), "the weight of link 0 is inf: weights must be"),
        (lambda: Network(2, [(0, 1)], [-1.0]).laplacian(0), "the weight of link 0 is -1.0: bound"),
        (
            lambda: Network(4, SQUARE).with_triangles([[0, 1, 2], [0, 1, 3]]),
            "triangle 1 (nodes 0, 1, 3): there is no link between 1 and 3",
        ),
        (
            lambda: Network(4, SQUARE).with_triangles([[0, 1, 1]]),
            "triangle 0 (nodes 0, 1, 1): there is no link between 1 and 1",
        ),
        (
            lambda: Network(4, SQUARE).with_triangles([[0, 1, 2], [2, 1, 0]]),
            "triangle 1 (nodes 2, 1, 0) repeats triangle 0",
        ),
        (
            lambda: Network(4, SQUARE, [1, 0, 1, 1, 1], [[0, 2, 3], [0, 1, 2]]).boundary(2),
            "triangle 1 has a side of weight 0",
        ),
        (lambda: Network(4, SQUARE).with_triangles("all"), 'triangles = "all": allowed are "cl'),
        (lambda: Network(4, SQUARE).with_order([0, 1, 2, 2]), "order: node 3 is missing"),
        (lambda: Network(4, SQUARE).with_order([0, 1, 2]), "order have shape (3,)"),
        (lambda: Network(4, SQUARE).with_groups([0, 1]), "groups have shape (2,)"),
        (lambda: Network(4, SQUARE).size("edges"), "signals = 'edges': allowed are \"nodes\""),
        (lambda: Network(4, SQUARE).boundary(3), "boundary(3): allowed are 1 (links) and 2"),
        (lambda: Network(4, SQUARE).laplacian(3), "k = 3: allowed are 0 (nodes)"),
        (lambda: Network(4, SQUARE).reorient_node(0, 1), "reorient_node is for rings"),
        (
            lambda: Network(4, SQUARE).reorient_random(6),
            "flips = 6: allowed is 0 to the 5 links of",
        ),
        (lambda: Network(3, [(0, 1)]).neighbour_mean, "node 2 has no links, and coupling is div"),
        (
            lambda: Network(3, [(0, 1), (1, 2)], [1.0, -1.0]).neighbour_mean,
            "the weights of node 1 add up to 0, and coupling is div",
        ),
        (
            lambda: Network(3, [(0, 1), (1, 2)], directed=True).neighbour_mean,
            "no link leads to node 0, and coupling is div",
        ),
        (lambda: ARROW.laplacian(0), "a directed network has no orientation, which a boundary"),
        (lambda: ARROW.divergence, "a directed network has no orientation"),
        (
            lambda: ARROW.with_triangles("cliques"),
            "a directed network has no orientation, which tri",
        ),
        (lambda: Network(2, [(0, 1)], ["far"]), "weights must be real numbers: could not"),
        (lambda: Network(2, [(0, 1)], [1j]), "weights must be real numbers: float() argument"),
        (lambda: Network(2, [(0, 1)]).reorient([1]), "link 1: allowed is 0 to 0"),
        (lambda: ARROW.reorient_random(1), "a directed network has no orientation, which reorient"),
    ],
)
def test_what_is_not_possible_is_refused_in_one_line(
    make: Callable[[], object], message: str
) -> None:
    assert refusal(make).startswith(message)
