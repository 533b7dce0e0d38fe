"""Makers of networks: counts, degrees and orientations of each; a seed gives one network."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from network_tools import refusal

from chimera_hpc import Network


def degrees(network: Network) -> list[int]:
    return np.bincount(network.links.ravel(), minlength=network.n_nodes).tolist()


def checked(network: Network) -> Network:
    """The same network from its parts, which are then checked."""
    again = Network(network.n_nodes, network.links, network.weights, groups=network.groups)
    assert again.digest == network.digest
    return again


def test_a_periodic_lattice_of_one_dimension_is_a_ring() -> None:
    lattice, ring = Network.lattice(7), Network.ring(7, 1)
    np.testing.assert_array_equal(lattice.links, ring.links)


def test_lattices_have_links_along_every_axis() -> None:
    torus = checked(Network.lattice((3, 4)))
    assert degrees(torus) == [4] * 12
    np.testing.assert_array_equal(torus.divergence, 0.0)
    assert torus.betti == (1, 13, 0)
    grid = checked(Network.lattice((2, 3), periodic=False))
    assert sorted(map(tuple, grid.links.tolist())) == [
        *[(0, 1), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (4, 5)],
    ]
    assert Network.lattice((1, 1, 1), periodic=False).n_links == 0


@given(st.integers(3, 30), st.data())
def test_small_worlds_keep_the_tails_of_a_ring(n: int, data: st.DataObject) -> None:
    half = data.draw(st.integers(1, (n - 1) // 2))
    rewire, seed = data.draw(st.sampled_from([0.0, 0.2, 1.0])), data.draw(st.integers(0, 99))
    world, ring = checked(Network.small_world(n, half, rewire, seed)), Network.ring(n, half)
    np.testing.assert_array_equal(world.links[:, 0], ring.links[:, 0])
    assert world.digest == Network.small_world(n, half, rewire, seed).digest
    if rewire == 0.0:
        assert world.digest == ring.digest


def test_the_share_of_rewired_links_is_that_asked_for() -> None:
    world, ring = Network.small_world(1000, 5, 0.1, 3), Network.ring(1000, 5)
    share = (world.links != ring.links).any(axis=1).mean()
    assert abs(share - 0.1) < 5 * np.sqrt(0.1 * 0.9 / 5000)
    # A higher share with the same seed rewires the same links and more.
    more = Network.small_world(1000, 5, 0.2, 3)
    first = (world.links != ring.links).any(axis=1)
    assert (more.links != ring.links).any(axis=1)[first].mean() > 0.99


def test_scale_free_networks_grow_by_m_links_per_node() -> None:
    network = checked(Network.scale_free(500, 3, 1))
    assert network.n_links == 3 * 497
    assert network.n_components == 1
    assert min(degrees(network)) >= 1
    assert max(degrees(network)) > 30
    assert (network.links[:, 0] < network.links[:, 1]).all()


def test_random_networks_have_the_mean_degree() -> None:
    network = checked(Network.random(200, 10.0, 4))
    assert np.mean(degrees(network)) == 10.0


def test_modular_networks_are_denser_within_their_groups() -> None:
    network = checked(Network.modular([40, 60], 0.5, 0.02, 2))
    assert network.groups is not None
    same = network.groups[network.links[:, 0]] == network.groups[network.links[:, 1]]
    within, across = 40 * 39 / 2 + 60 * 59 / 2, 40 * 60
    for count, pairs, share in ((same.sum(), within, 0.5), ((~same).sum(), across, 0.02)):
        assert abs(count - share * pairs) < 5 * np.sqrt(pairs * share * (1 - share))


def test_each_pair_of_a_modular_network_is_linked_with_its_probability() -> None:
    count = np.zeros((5, 5))
    for seed in range(500):
        tail, head = Network.modular([3, 2], 0.6, 0.2, seed).links.T
        count[tail, head] += 1
    expected = 500 * np.array([[0.6] * 3 + [0.2] * 2] * 3 + [[0.0] * 3 + [0.6] * 2] * 2)
    i, j = np.triu_indices(5, 1)
    assert (np.abs(count - expected)[i, j] < 5 * np.sqrt(500 * 0.25)).all()
    assert count[j, i].sum() == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda seed: Network.small_world(30, 3, 0.5, seed),
        lambda seed: Network.scale_free(30, 2, seed),
        lambda seed: Network.random(30, 4.0, seed),
        lambda seed: Network.modular([15, 15], 0.5, 0.1, seed),
    ],
)
def test_random_networks_follow_their_seed(make: Callable[..., Network]) -> None:
    assert make(1).digest == make(1).digest == make(np.random.default_rng(1)).digest
    assert len({make(seed).digest for seed in range(5)}) == 5


def test_random_networks_are_the_same_in_every_version() -> None:
    found = [
        Network.small_world(20, 2, 0.5, 1),
        Network.scale_free(20, 2, 1),
        Network.random(20, 4.0, 1),
        Network.modular([10, 10], 0.5, 0.1, 1),
    ]
    assert [network.digest for network in found] == DIGESTS


DIGESTS = ["f5f796f78b96674e", "afe77aca24710c78", "c156f07806a681c8", "ddcc8fd1464ac5da"]


def test_two_populations_have_the_weights_of_the_literature() -> None:
    network = checked(Network.two_populations(3, 0.2))
    expected = np.kron([[1.2, 0.8], [0.8, 1.2]], np.ones((3, 3))) / 6.0
    np.fill_diagonal(expected, 0.0)
    np.testing.assert_allclose(network.adjacency.toarray(), expected, atol=1e-16)
    assert network.communities.tolist() == [0, 0, 0, 1, 1, 1]


def test_layers_of_a_multiplex_share_their_nodes() -> None:
    network = Network.multiplex([Network.ring(5, 1), Network.ring(5, 2)], 0.5)
    ring, second = (Network.ring(5, P).adjacency.toarray() for P in (1, 2))
    expected = np.block([[ring, 0.5 * np.eye(5)], [0.5 * np.eye(5), second]])
    np.testing.assert_array_equal(network.adjacency.toarray(), expected)
    assert network.groups is not None
    assert network.groups.tolist() == [0] * 5 + [1] * 5


def test_communities_are_found_and_order_the_nodes() -> None:
    network = Network.modular([10, 10, 10], 0.9, 0.02, 0)
    found = network.with_groups(None)
    assert found.communities.tolist() == network.communities.tolist()
    new = np.random.default_rng(0).permutation(30)
    mixed = found.relabel(new)
    assert np.argsort(new)[mixed.order].tolist() != list(range(30))
    assert [set(part) for part in np.split(mixed.communities[mixed.order], 3)] == [{0}, {1}, {2}]
    assert Network.ring(9, 2).order.tolist() == list(range(9))
    assert network.with_order(np.arange(30)[::-1]).order.tolist() == list(range(29, -1, -1))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Network.lattice((3, 2)), "shape = (3, 2): the sides of a periodic lattice are at"),
        (lambda: Network.lattice((0,), periodic=False), "shape = (0,): the sides of a lattice are"),
        (lambda: Network.lattice((10**5, 10**5)), "1e+10 links or nodes: at most 5e+07 are allow"),
        (lambda: Network.small_world(8, 4, 0.1), "P = 4 on a ring of 8 nodes: 1 <= P and 2 P < n"),
        (lambda: Network.small_world(9, 4, 1.5), "rewire = 1.5: allowed is 0 to 1"),
        (lambda: Network.small_world(9, 4, float("nan")), "rewire = nan: allowed is 0 to 1"),
        (lambda: Network.scale_free(5, 5), "m = 5 links per new node: allowed is 1 to n - 1 = 4"),
        (lambda: Network.random(5, 4.5), "mean_degree = 4.5: allowed is 0 to n - 1 = 4"),
        (lambda: Network.modular([3, 0], 0.5, 0.1), "sizes = [3, 0]: every group has at least one"),
        (lambda: Network.modular([3, 3], -0.5, 0.1), "p_in = -0.5: allowed is 0 to 1"),
        (lambda: Network.two_populations(0, 0.2), "n = 0 nodes in each population: at least 1"),
        (lambda: Network.two_populations(3, 1.2), "A = 1.2: allowed is -1 to 1"),
        (
            lambda: Network.multiplex([Network.ring(5, 1), Network.ring(6, 1)]),
            "layers with [5, 6] nodes: all layers must have the same nodes",
        ),
        (lambda: Network.multiplex([]), "layers with [] nodes: all layers must have the same"),
    ],
)
def test_what_is_not_possible_is_refused_in_one_line(
    make: Callable[[], object], message: str
) -> None:
    assert refusal(make).startswith(message)
