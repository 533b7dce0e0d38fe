"""The places of the nodes in a picture of a network, and the order in which signals are drawn."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network.checks import Array, Integers
from chimera_hpc.network.network import Network

LAYOUTS = ("auto", "spring", "circular")
MOST_SPRING = 500
"""Nodes of the largest network whose nodes all push each other: the time grows with its square."""
_DENSE = 0.5
"""Share of all pairs that are linked, from which on springs show nothing."""
_PIVOTS, _SAMPLE, _ROUNDS = 50, 24, 60
"""Nodes to which distances are taken, and the samples and rounds of springs, of large networks."""
_FEW, _MOST_PARTS = 3, 200
"""Nodes of parts that are drawn as circles, and the parts after which all are."""
_MOST_ORDERED = 50_000
"""Most links of a network whose communities are looked for to draw it."""


def node_places(network: Network, layout: str | ArrayLike = "auto") -> Array:
    """Return the places (N0, 2) of the nodes, within -1 to 1.

    "circular" has them on a circle clockwise from the top, in the order of `picture_order`.
    "spring" draws linked nodes together and pushes others apart: the layout of Fruchterman and
    Reingold, or a faster one above `MOST_SPRING` nodes. Both give the same places in every call.
    Parts that are not connected, and nodes without links, lie side by side, the largest at the top
    left. "auto" is circular for rings and dense networks, and spring for others. An array (N0, 2)
    gives the places; they are scaled to fit.

    Raises
    ------
    BadInput
        Another word, or places of another shape or that are not finite.
    """
    if not isinstance(layout, str):
        return _given(network, layout)
    if layout not in LAYOUTS:
        raise BadInput(f'layout = "{layout}": allowed are {", ".join(LAYOUTS)}, or places (x, y)')
    return _places(network, _chosen(network) if layout == "auto" else layout)


def chosen_layout(text: str) -> str | Array:
    """Return a word of `LAYOUTS`, or the places (n, 2) in a file that a user names.

    The file is a .npy array or a text with x and y on each line, with commas or spaces between.

    Raises
    ------
    BadInput
        Neither a word nor a file of such numbers.
    """
    if text in LAYOUTS:
        return text
    path = Path(text)
    if not path.is_file():
        raise BadInput(f'layout "{text}": no such file; the words are {", ".join(LAYOUTS)}')
    try:
        if path.suffix == ".npy":
            return np.asarray(np.load(path, allow_pickle=False), dtype=np.float64)
        lines = path.read_text(encoding="utf-8").replace(",", " ").splitlines()
        return np.array([line.split() for line in lines if line.strip()], dtype=np.float64)
    except (OSError, ValueError) as error:
        raise BadInput(f"layout {path}: {error}") from None


def circle(n_nodes: int) -> Array:
    """Return the places (n_nodes, 2) on the unit circle, node 0 at the top, then clockwise."""
    angle = 0.5 * np.pi - 2.0 * np.pi * np.arange(n_nodes) / n_nodes
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def picture_order(network: Network, signals: str = "nodes") -> Integers | None:
    """Return the order (N_k,) of signals in pictures; None where it is that of their numbers.

    Nodes are in the order of the network, links and triangles by their nodes' places in it.
    Communities of more than 50,000 links are not looked for.
    """
    known = network.node_order is not None or network.groups is not None or network.half_degree
    if not known and network.n_links > _MOST_ORDERED:
        return None
    order = network.order
    if signals != "nodes":
        rank = np.argsort(order)
        sides = network.links if signals == "links" else network.triangles
        assert sides is not None
        order = np.lexsort(np.sort(rank[sides], axis=1).T[::-1])
    return None if np.array_equal(order, np.arange(len(order))) else order


def community_bounds(network: Network, order: Integers | None) -> Integers:
    """Return the places along the order at which another community begins; none of a ring."""
    if order is None and network.groups is None:
        return np.empty(0, dtype=np.int64)
    labels = network.communities if order is None else network.communities[order]
    found: Integers = 1 + np.flatnonzero(np.diff(labels))
    # An order of one's own need not keep communities together.
    return found if len(found) < len(np.unique(labels)) else found[:0]


def _chosen(network: Network) -> str:
    n = network.n_nodes
    dense = 2 * network.n_links > _DENSE * n * (n - 1)
    return "circular" if network.half_degree or dense else "spring"


@lru_cache(maxsize=64)
def _places(network: Network, layout: str) -> Array:
    if layout == "circular":
        order = picture_order(network)
        places = circle(network.n_nodes)
        if order is not None:
            places = places[np.argsort(order)]
    else:
        places = _scaled(_side_by_side(network))
    places.flags.writeable = False
    return places


def _side_by_side(network: Network) -> Array:
    """Return places by springs of each connected part, in squares with sides sqrt(its nodes)."""
    parts = _parts(network)
    if len(parts) == 1:
        return _springs(network.n_nodes, network.links)
    sides = np.sqrt([len(nodes) for nodes, _ in parts])
    places = np.empty((network.n_nodes, 2))
    for rank, ((nodes, links), corner) in enumerate(zip(parts, _corners(sides), strict=True)):
        few = len(nodes) <= _FEW or rank >= _MOST_PARTS
        own = _scaled(circle(len(nodes)) if few else _springs(len(nodes), links))
        places[nodes] = corner + 0.5 * sides[rank] * (1.0 + 0.9 * own)
    return places * (1.0, -1.0)


def _parts(network: Network) -> list[tuple[Integers, Integers]]:
    """Return the nodes of each connected part, and its links among them; the largest first."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n, links = network.n_nodes, network.links
    graph = csr_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n))
    _, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels)
    nodes = np.split(np.argsort(labels, kind="stable"), np.cumsum(sizes)[:-1])
    number = np.empty(n, dtype=np.int64)
    number[np.concatenate(nodes)] = np.concatenate([np.arange(size) for size in sizes])
    owner = labels[links[:, 0]]
    ends = np.cumsum(np.bincount(owner, minlength=len(sizes)))[:-1]
    own = np.split(number[links[np.argsort(owner, kind="stable")]], ends)
    return [(nodes[part], own[part]) for part in np.argsort(-sizes, kind="stable")]


def _corners(sides: Array) -> Array:
    """Return corners (k, 2) of squares, the largest first, in rows that fill about a square."""
    width = max(sides[0], float(np.sqrt(1.2 * (sides**2).sum())))
    corners = np.empty((len(sides), 2))
    x = y = high = 0.0
    for k, side in enumerate(sides.tolist()):
        if x > 0.0 and x + side > width:
            x, y, high = 0.0, y + high, 0.0
        corners[k] = x, y
        x, high = x + side, max(high, side)
    return corners


def _springs(n_nodes: int, links: Integers) -> Array:
    """Return places (n_nodes, 2) of one connected part."""
    if n_nodes > MOST_SPRING:
        return _large(n_nodes, links)
    from networkx import Graph, spring_layout

    graph = Graph()
    graph.add_nodes_from(range(n_nodes))
    graph.add_edges_from(links.tolist())
    found = spring_layout(graph, seed=0, iterations=100)
    return np.array([found[i] for i in range(n_nodes)])


def _large(n: int, links: Integers) -> Array:
    """Return places by the distances to some nodes, then by springs with samples of the pushes.

    The first is PivotMDS (U. Brandes, C. Pich, Graph Drawing 2006). In each round of the second, a
    node is pushed by `_SAMPLE` others, drawn at random, with a multiple of the force.
    """
    rng = np.random.default_rng(0)
    places = _scaled(_pivots(n, links, rng)) + 0.01 * rng.standard_normal((n, 2))
    tail, head = links.T
    length = 1.0 / np.sqrt(n)
    for step in np.geomspace(0.1, 0.002, _ROUNDS):
        apart = places[:, None] - places[rng.integers(n, size=(n, _SAMPLE))]
        square = np.maximum((apart**2).sum(axis=2, keepdims=True), 1e-6)
        force = n / _SAMPLE * length**2 * (apart / square).sum(axis=1)
        along = places[head] - places[tail]
        pull = along * (np.linalg.norm(along, axis=1, keepdims=True) / length)
        for axis in range(2):
            force[:, axis] += np.bincount(tail, pull[:, axis], n)
            force[:, axis] -= np.bincount(head, pull[:, axis], n)
        size = np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-12)
        places = places + force / size * np.minimum(size, step)
    return places


def _pivots(n: int, links: Integers, rng: np.random.Generator) -> Array:
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    graph = csr_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n))
    chosen = rng.permutation(n)[:_PIVOTS]
    square = dijkstra(graph, directed=False, indices=chosen, unweighted=True).T ** 2
    centred = square - square.mean(axis=0) - square.mean(axis=1, keepdims=True) + square.mean()
    found: Array = centred @ np.linalg.svd(centred.T @ centred)[0][:, :2]
    return found


def _given(network: Network, layout: ArrayLike) -> Array:
    places = np.asarray(layout, dtype=np.float64)
    if places.shape != (network.n_nodes, 2) or not np.isfinite(places).all():
        raise BadInput(
            f"layout: {network.n_nodes} finite pairs (x, y) are needed, one per node; "
            f"the shape is {places.shape}"
        )
    return _scaled(places)


def _scaled(places: NDArray[np.float64]) -> Array:
    """Move places into the square from -1 to 1; both axes keep one scale."""
    low, high = places.min(axis=0), places.max(axis=0)
    size = float((high - low).max()) or 1.0
    scaled: Array = 2.0 * (places - 0.5 * (low + high)) / size
    return scaled
