"""Links of standard networks; `Network` has a maker for each, with its documentation.

Every function returns the parts of a network by name. networkx draws two of the random ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from random import Random
from typing import TYPE_CHECKING, Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import generator
from chimera_hpc.network.checks import Integers
from chimera_hpc.network.hodge import ring_links

if TYPE_CHECKING:
    from chimera_hpc.network.complex import SimplicialComplex

Seed = int | np.random.Generator
Parts = dict[str, Any]

MOST_LINKS = 5 * 10**7
"""Most links that a maker draws: 800 MB of them."""


def lattice(shape: int | Sequence[int], periodic: bool) -> Parts:
    """Return links from each node to the next one along every axis; nodes in row-major order."""
    sides = [shape] if isinstance(shape, int) else [int(side) for side in shape]
    smallest = 3 if periodic else 1
    if not sides or min(sides) < smallest:
        which = "a periodic lattice" if periodic else "a lattice"
        raise BadInput(f"shape = {shape}: the sides of {which} are at least {smallest}")
    numbers = np.arange(_few(float(np.prod(sides, dtype=np.float64)))).reshape(sides)
    links = []
    for axis, side in enumerate(sides):
        tail, head = numbers, np.roll(numbers, -1, axis)
        if not periodic:
            tail, head = (np.take(x, range(side - 1), axis) for x in (tail, head))
        links.append(np.stack([tail, head], axis=-1).reshape(-1, 2))
    return {"n_nodes": numbers.size, "links": np.concatenate(links)}


def small_world(n: int, P: int, rewire: float, seed: Seed) -> Parts:
    """Return a ring whose links have a new head with probability `rewire` (Watts and Strogatz)."""
    if P < 1 or n <= 2 * P:
        raise BadInput(f"P = {P} on a ring of {n} nodes: 1 <= P and 2 P < n are needed")
    _share("rewire", rewire)
    _few(n * float(P))
    rng = generator(seed)
    links = ring_links(n, P)
    chosen = np.flatnonzero(rng.random(len(links)) < rewire)
    # Nearest neighbours first, as Watts and Strogatz go around the ring.
    _new_heads(n, links, chosen[np.argsort(chosen % P, kind="stable")], rng)
    return {"n_nodes": n, "links": links}


def _new_heads(n: int, links: Integers, chosen: Integers, rng: np.random.Generator) -> None:
    """Give each chosen link, in place, a head that its tail is not linked to, drawn uniformly."""
    near: list[set[int]] = [set() for _ in range(n)]
    for a, b in links.tolist():
        near[a].add(b)
        near[b].add(a)
    for index in chosen.tolist():
        tail, old = links[index].tolist()
        if len(near[tail]) == n - 1:
            continue
        new = int(rng.integers(n))
        while new == tail or new in near[tail]:
            new = int(rng.integers(n))
        near[tail] ^= {old, new}
        near[old].remove(tail)
        near[new].add(tail)
        links[index, 1] = new


def scale_free(n: int, m: int, seed: Seed) -> Parts:
    """Return the graph of Barabasi and Albert: each new node has m links, to nodes by degree."""
    from networkx import barabasi_albert_graph

    if not 1 <= m < n:
        raise BadInput(f"m = {m} links per new node: allowed is 1 to n - 1 = {n - 1}")
    _few(n * float(m))
    return _parts(barabasi_albert_graph(n, m, seed=_python_random(seed)))


def random(n: int, mean_degree: float, seed: Seed) -> Parts:
    """Return a graph with n mean_degree / 2 links, rounded, drawn uniformly (Erdos and Renyi)."""
    from networkx import gnm_random_graph

    if n < 1 or not 0.0 <= mean_degree <= n - 1:
        raise BadInput(f"mean_degree = {mean_degree}: allowed is 0 to n - 1 = {n - 1}")
    count = _few(round(n * mean_degree / 2.0))
    return _parts(gnm_random_graph(n, count, seed=_python_random(seed)))


def modular(sizes: Sequence[int], p_in: float, p_out: float, seed: Seed) -> Parts:
    """Return groups of nodes with a link within them with p_in, between them with p_out."""
    if not len(sizes) or min(sizes) < 1:
        raise BadInput(f"sizes = {list(sizes)}: every group has at least one node")
    _share("p_in", p_in)
    _share("p_out", p_out)
    _few(sum(map(float, sizes)) ** 2 / 2.0 * max(p_in, p_out))
    rng, starts = generator(seed), np.cumsum([0, *sizes])
    links = [_within(n, p_in, rng) + start for n, start in zip(sizes, starts[:-1], strict=True)]
    for a, b in combinations(range(len(sizes)), 2):
        tail, head = np.divmod(_chosen(sizes[a] * sizes[b], p_out, rng), sizes[b])
        links.append(np.column_stack([starts[a] + tail, starts[b] + head]))
    found = np.concatenate(links)
    return {
        "n_nodes": int(starts[-1]),
        "links": found[np.lexsort(found.T[::-1])],
        "groups": np.repeat(np.arange(len(sizes)), sizes),
    }


def _within(n: int, p: float, rng: np.random.Generator) -> Integers:
    """Return the pairs of n nodes that are chosen, each with probability p."""
    row = np.cumsum(np.arange(n)[::-1])  # pairs up to the last one of each tail
    chosen = _chosen(n * (n - 1) // 2, p, rng)
    tail = np.searchsorted(row, chosen, side="right")
    return np.column_stack([tail, chosen - row[tail] + n])


def _chosen(count: int, p: float, rng: np.random.Generator) -> Integers:
    """Return which of so many are chosen, each with probability p; takes time per chosen one."""
    if p in (0.0, 1.0):
        return np.arange(count if p else 0)
    at, found = -1, []
    while at < count:
        # The distance from one to the next has a geometric distribution.
        skips = np.floor(np.log1p(-rng.random(1000)) / np.log1p(-p))
        found.append(at + np.cumsum(1 + np.minimum(skips, count).astype(np.int64)))
        at = int(found[-1][-1])
    every = np.concatenate(found)
    return every[every < count]


def two_populations(n: int, A: float) -> Parts:
    """Return all pairs of 2 n nodes, with weights (1 + A)/(2 n) within and (1 - A)/(2 n) across."""
    if n < 1:
        raise BadInput(f"n = {n} nodes in each population: at least 1 is needed")
    if not -1.0 <= A <= 1.0:
        raise BadInput(f"A = {A}: allowed is -1 to 1")
    _few(2.0 * n * n)
    links = np.column_stack(np.triu_indices(2 * n, 1))
    within = (links[:, 0] < n) == (links[:, 1] < n)
    weights = np.where(within, 1.0 + A, 1.0 - A) / (2 * n)
    return {
        "n_nodes": 2 * n,
        "links": links,
        "weights": weights,
        "groups": np.repeat([0, 1], n),
    }


def multiplex(layers: Sequence[SimplicialComplex], coupling: float) -> Parts:
    """Return the layers one after the other, with links between all copies of a node."""
    sizes = {layer.n_nodes for layer in layers}
    if len(sizes) != 1:
        raise BadInput(f"layers with {sorted(sizes)} nodes: all layers must have the same nodes")
    if any(layer.directed for layer in layers):
        raise BadInput(
            "a layer is a directed network: the layers of a multiplex have no directions"
        )
    n, count = sizes.pop(), len(layers)
    links: list[Integers] = [layer.links + index * n for index, layer in enumerate(layers)]
    nodes = np.arange(n)
    between = [
        np.column_stack([nodes + a * n, nodes + b * n]) for a, b in combinations(range(count), 2)
    ]
    weights = [np.ones(x.n_links) if x.weights is None else x.weights for x in layers]
    weights.append(np.full(n * len(between), float(coupling)))
    return {
        "n_nodes": n * count,
        "links": np.concatenate(links + between),
        "weights": np.concatenate(weights),
        "groups": np.repeat(np.arange(count), n),
    }


def _parts(graph: Any) -> Parts:
    """Return a networkx graph on 0..n-1 with links from lower to higher nodes, in rising order."""
    links = np.sort(np.array(graph.edges, dtype=np.int64).reshape(-1, 2), axis=1)
    return {
        "n_nodes": graph.number_of_nodes(),
        "links": links[np.lexsort(links.T[::-1])],
    }


def _python_random(seed: Seed) -> Random:
    """Return Python's generator, whose numbers are the same in every version, for networkx."""
    return Random(int(generator(seed).integers(2**63)))


def _share(name: str, value: float) -> None:
    if not 0.0 <= value <= 1.0:
        raise BadInput(f"{name} = {value}: allowed is 0 to 1")


def _few(count: float) -> int:
    if count > MOST_LINKS:
        raise BadInput(f"{count:.2g} links or nodes: at most {MOST_LINKS:.0e} are allowed")
    return int(count)
