"""Where pictures have the nodes of a network, and in which order its signals are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chimera_hpc import Network
from chimera_hpc.base.errors import BadInput
from chimera_hpc.network import layout
from chimera_hpc.network.layout import chosen_layout, community_bounds, node_places, picture_order

SHUFFLED = Network.modular([6, 6, 6], 0.9, 0.05, seed=1).relabel(
    np.random.default_rng(0).permutation(18)
)


def test_ring_is_a_circle_clockwise_from_the_top() -> None:
    places = node_places(Network.ring(8, 2))
    np.testing.assert_allclose(places[[0, 2, 4]], [[0, 1], [1, 0], [0, -1]], atol=1e-15)


def test_circle_has_communities_side_by_side() -> None:
    places = node_places(SHUFFLED, "circular")
    around = np.argsort((0.5 * np.pi - np.arctan2(*places.T[::-1])) % (2.0 * np.pi), kind="stable")
    labels = SHUFFLED.communities[around]
    assert np.count_nonzero(labels != np.roll(labels, 1)) == 3


def closeness(network: Network) -> float:
    """Mean length of links over the mean distance of all pairs."""
    places: NDArray[np.float64] = node_places(network, "spring")
    assert np.abs(places).max() == pytest.approx(1.0)
    tail, head = network.links.T
    links = np.linalg.norm(places[tail] - places[head], axis=1).mean()
    pairs = np.linalg.norm(places[:, None] - places, axis=2).mean()
    return float(links / pairs)


def test_springs_draw_linked_nodes_together() -> None:
    assert closeness(SHUFFLED) < 0.6


def test_springs_of_large_networks_do_so_too_the_same_in_every_call(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(layout, "MOST_SPRING", 20)
    lattice = Network.lattice((12, 12), periodic=False)
    assert closeness(lattice) < 0.3
    first = node_places(lattice)
    layout._places.cache_clear()
    np.testing.assert_array_equal(node_places(lattice), first)


@pytest.mark.parametrize("largest", [500, 10])
def test_nodes_without_links_and_other_parts_leave_the_room_to_the_rest(
    largest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(layout, "MOST_SPRING", largest)
    clique = [(i, j) for i in range(16) for j in range(i)]
    places = node_places(Network(32, [(a + 8, b + 8) for a, b in clique] + [(30, 31)]), "spring")
    clique_places = places[8:24]
    assert np.ptp(clique_places, axis=0).max() > 0.5 * np.ptp(places, axis=0).max()
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 9.0 * np.eye(32)
    assert apart.min() > 0.02
    low, high = clique_places.min(axis=0), clique_places.max(axis=0)
    others = np.delete(places, np.s_[8:24], axis=0)
    assert not ((others >= low) & (others <= high)).all(axis=1).any()


def test_large_network_in_pieces_has_finite_places(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout, "MOST_SPRING", 4)
    layout._places.cache_clear()
    assert np.isfinite(node_places(Network(6, [(0, 1), (2, 3)]))).all()


def test_given_places_are_scaled_with_one_scale() -> None:
    triangle = Network(3, [(0, 1), (1, 2)])
    places = node_places(triangle, [(10.0, 0.0), (14.0, 0.0), (12.0, 1.0)])
    np.testing.assert_allclose(places, [[-1, -0.25], [1, -0.25], [0, 0.25]])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("star", 'layout = "star": allowed are auto, spring, circular'),
        ([(0.0, 1.0)], r"3 finite pairs \(x, y\) are needed"),
        ([(0.0, 1.0), (np.nan, 0.0), (1.0, 1.0)], "3 finite pairs"),
    ],
)
def test_other_layouts_are_refused(given: object, said: str) -> None:
    with pytest.raises(BadInput, match=said):
        node_places(Network(3, [(0, 1), (1, 2)]), given)  # type: ignore[arg-type]


def test_layout_comes_from_a_word_or_a_file(tmp_path: Path) -> None:
    assert chosen_layout("spring") == "spring"
    (tmp_path / "xy.csv").write_text("0, 1\n2, 3\n")
    np.save(tmp_path / "xy.npy", [[0.0, 1.0], [2.0, 3.0]])
    for name in ("xy.csv", "xy.npy"):
        np.testing.assert_array_equal(chosen_layout(str(tmp_path / name)), [[0, 1], [2, 3]])
    (tmp_path / "words.csv").write_text("a b\n")
    for name, said in (("words.csv", "could not convert"), ("none.csv", "no such file")):
        with pytest.raises(BadInput, match=said):
            chosen_layout(str(tmp_path / name))


def test_signals_are_in_the_order_of_communities() -> None:
    assert picture_order(Network.ring(8, 2)) is None
    assert picture_order(Network.modular([3, 3], 1.0, 0.0, seed=0)) is None
    order = picture_order(SHUFFLED)
    assert order is not None
    np.testing.assert_array_equal(order, SHUFFLED.order)
    assert len(community_bounds(SHUFFLED, order)) == 2
    links = picture_order(SHUFFLED, "links")
    assert links is not None
    rank = np.argsort(order)[SHUFFLED.links[links]].min(axis=1)
    assert (np.diff(rank) >= 0).all()


def test_communities_are_looked_for_in_networks_that_are_not_too_large(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    unknown = Network.from_edges(SHUFFLED.links)
    assert unknown.groups is None
    assert len(community_bounds(unknown, picture_order(unknown))) == 2
    monkeypatch.setattr(layout, "_MOST_ORDERED", unknown.n_links - 1)
    assert picture_order(unknown) is None
    assert picture_order(SHUFFLED) is not None


def test_order_of_ones_own_that_mixes_communities_has_no_bounds() -> None:
    mixed = Network.modular([3, 3], 1.0, 0.0, seed=0).with_order([0, 3, 1, 4, 2, 5])
    assert len(community_bounds(mixed, picture_order(mixed))) == 0
