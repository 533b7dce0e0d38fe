"""Networks from and to networkx, XGI and matrices; orientations are kept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network.checks import Array, Integers
from chimera_hpc.network.generators import Parts

if TYPE_CHECKING:
    from chimera_hpc.network.complex import SimplicialComplex

MOST_NUMBERED = 10**7
"""Most nodes of a list of links that does not say how many there are: more are likely names."""
# Attributes of networkx graphs that keep what an undirected graph does not.
ORIENTATION, PLACE, GROUP, TRIANGLES = "orientation", "link", "group", "triangles"


def from_edges(
    edges: ArrayLike, n_nodes: int | None, weights: ArrayLike | None, directed: bool
) -> Parts:
    """Return the parts of a list of (tail, head) or (tail, head, weight)."""
    array = np.asarray(edges)
    if array.size == 0:
        array = np.empty((0, 2), dtype=np.int64)
    if array.ndim == 2 and array.shape[1] == 3 and weights is None:
        array, weights = array[:, :2], array[:, 2]
    if n_nodes is None:
        numbers = array.dtype.kind in "iuf" and array.ndim == 2 and len(array) > 0
        n_nodes = numbered(int(np.nanmax(array))) if numbers else 1
    return {"n_nodes": n_nodes, "links": array, "weights": weights, "directed": directed}


def numbered(largest: int) -> int:
    """Return the number of nodes of a list of links, by the largest number in it."""
    if largest >= MOST_NUMBERED:
        raise BadInput(
            f"node {largest}: nodes count from 0, up to {MOST_NUMBERED - 1}; number those that "
            "there are, or give n_nodes"
        )
    return largest + 1


def from_networkx(graph: Any, weight: str, group: str, directed: bool | None) -> Parts:
    """Return the parts of a networkx graph; its nodes are numbered in the graph's order."""
    if graph.is_multigraph():
        raise BadInput(
            "a multigraph may link two nodes several times: give networkx.Graph(graph) or "
            "networkx.DiGraph(graph)"
        )
    number = {node: index for index, node in enumerate(graph)}
    edges = sorted(graph.edges(data=True), key=lambda edge: edge[2].get(PLACE, 0))
    links = np.array([(number[a], number[b]) for a, b, _ in edges], dtype=np.int64).reshape(-1, 2)
    if not graph.is_directed():
        signs = np.array([data.get(ORIENTATION, 1) for _, _, data in edges], dtype=np.int64)
        links.sort(axis=1)
        links[signs < 0] = links[signs < 0, ::-1]
    weighted = any(weight in data for _, _, data in edges)
    triangles = graph.graph.get(TRIANGLES)
    return {
        "n_nodes": len(number),
        "links": links,
        "weights": [_number(weight, e) for e in edges] if weighted else None,
        "triangles": triangles,
        "directed": graph.is_directed() if directed is None else directed,
        "groups": _groups([data.get(group) for _, data in graph.nodes(data=True)]),
    }


def to_networkx(network: SimplicialComplex) -> Any:
    """Return a networkx Graph, or DiGraph if directed, that `from_networkx` reads without loss."""
    import networkx

    graph: Any = networkx.DiGraph() if network.directed else networkx.Graph()
    graph.add_nodes_from(range(network.n_nodes))
    if network.groups is not None:
        for node, group in enumerate(network.groups.tolist()):
            graph.nodes[node][GROUP] = group
    for place, (tail, head) in enumerate(network.links.tolist()):
        data: dict[str, Any] = {PLACE: place, ORIENTATION: 1 if tail < head else -1}
        if network.weights is not None:
            data["weight"] = float(network.weights[place])
        graph.add_edge(tail, head, **data)
    if network.triangles is not None:
        graph.graph[TRIANGLES] = network.triangles.tolist()
    return graph


def louvain(network: SimplicialComplex) -> Integers:
    """Return the number of each node's community, found by networkx with a fixed seed."""
    from networkx.algorithms.community import louvain_communities

    labels = np.empty(network.n_nodes, dtype=np.int64)
    found = louvain_communities(to_networkx(network), seed=0)
    for label, nodes in enumerate(sorted(map(sorted, found))):
        labels[nodes] = label
    return labels


def from_adjacency(matrix: Any, directed: bool | None) -> Parts:
    """Return the parts of a square matrix; entry (i, j) is the weight of the link from j to i."""
    array = _sparse("adjacency", matrix)
    n = array.shape[0]
    if array.shape != (n, n):
        raise BadInput(f"adjacency has shape {array.shape}: it must be square")
    head, tail, weights = array.row, array.col, array.data
    if not np.isfinite(weights).all():
        index = int(np.argmin(np.isfinite(weights)))
        raise BadInput(f"adjacency[{head[index]}, {tail[index]}] is {weights[index]}")
    symmetric = abs(array - array.T).max() == 0.0 if array.nnz else True
    if directed is False and not symmetric:
        raise BadInput("adjacency is not symmetric: it is of a directed network")
    directed = not symmetric if directed is None else directed
    kept = np.ones(len(head), dtype=np.bool_) if directed else tail <= head
    links = np.column_stack([tail, head])[kept]
    rising = np.lexsort(links.T[::-1])
    weights = weights[kept][rising]
    return {
        "n_nodes": n,
        "links": links[rising],
        "weights": None if (weights == 1.0).all() else weights,
        "directed": directed,
    }


def from_boundaries(b_1: Any, b_2: Any) -> Parts:
    """Return the parts of B_1, shape (N0, N1), and B_2, shape (N1, N2), as `boundary` has them."""
    first = _sparse("B1", b_1)
    n_nodes, n_links = first.shape
    heads, tails = first.data > 0.0, first.data < 0.0
    head, tail = np.full(n_links, -1), np.full(n_links, -1)
    head[first.col[heads]], tail[first.col[tails]] = first.row[heads], first.row[tails]
    size = np.zeros((2, n_links))
    size[0, first.col[heads]], size[1, first.col[tails]] = first.data[heads], -first.data[tails]
    wrong = (np.bincount(first.col, minlength=n_links) != 2) | (size[0] != size[1]) | (size[0] == 0)
    if wrong.any():
        raise BadInput(
            f"column {int(np.argmax(wrong))} of B1: a link has two entries, + at its head and "
            "- at its tail, of one size"
        )
    unit = bool((size == 1.0).all())
    parts = {
        "n_nodes": n_nodes,
        "links": np.column_stack([tail, head]),
        "weights": None if unit else size[0] ** 2,
    }
    return parts if b_2 is None else {**parts, "triangles": _triangles(first, b_2, parts["links"])}


def _triangles(b_1: Any, b_2: Any, links: Integers) -> Integers:
    """Return the nodes of the triangles whose sides B_2 has; B_1 B_2 = 0 is checked."""
    second = _sparse("B2", b_2).tocsc()
    if second.shape[0] != b_1.shape[1]:
        raise BadInput(f"B2 has {second.shape[0]} rows: B1 has {b_1.shape[1]} links")
    # Each side counts with the weight that it has in B_1, so that an entry of B2 comes out as 1.
    size = np.zeros(len(links))
    size[b_1.col] = abs(b_1.data)
    product = abs(b_1 @ second).tocsc()
    found = []
    for index in range(second.shape[1]):
        sides = slice(second.indptr[index], second.indptr[index + 1])
        rows, signs = second.indices[sides], second.data[sides]
        named = ", ".join(map(str, rows.tolist()))
        left = product.data[product.indptr[index] : product.indptr[index + 1]]
        nodes = set(links[rows].ravel().tolist())
        if len(rows) != 3 or len(nodes) != 3 or left.max(initial=0.0) > 1e-12:
            raise BadInput(
                f"triangle {index} (links {named}) of B2: its links do not close, B1 B2 is not 0"
            )
        if abs(abs(signs) * size[rows] - 1.0).max() > 1e-12:
            raise BadInput(f"triangle {index} of B2 has a weight: triangles cannot have weights")
        a, b = links[rows[0]].tolist()[:: 1 if signs[0] > 0.0 else -1]
        (c,) = nodes - {a, b}
        found.append((a, b, c))
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def from_xgi(simplices: Any, orientations: Mapping[Any, int] | None) -> Parts:
    """Return the parts of an XGI SimplicialComplex; larger simplices count by their triangles.

    As in XGI, a simplex runs through its sorted nodes, or against that if its orientation is 1.
    """
    number = {node: index for index, node in enumerate(simplices.nodes)}
    turned = {} if orientations is None else orientations
    found: dict[int, list[list[int]]] = {2: [], 3: []}
    for name in simplices.edges:
        members = sorted(simplices.edges.members(name), key=lambda x: (isinstance(x, str), x))
        if len(members) in found:
            nodes = [number[node] for node in members]
            if turned.get(name, 0):
                nodes[-2:] = nodes[:-3:-1]
            found[len(members)].append(nodes)
    return {
        "n_nodes": len(number),
        "links": np.array(found[2], dtype=np.int64).reshape(-1, 2),
        "triangles": np.array(found[3], dtype=np.int64).reshape(-1, 3) if found[3] else None,
    }


def to_xgi(network: SimplicialComplex) -> tuple[Any, dict[int, int]]:
    """Return an XGI SimplicialComplex and the orientations of its simplices, by their names."""
    import xgi

    simplices = xgi.SimplicialComplex()
    simplices.add_nodes_from(range(network.n_nodes))
    triangles = [] if network.triangles is None else network.triangles.tolist()
    orientations = {}
    for name, nodes in enumerate(network.links.tolist() + triangles):
        simplices.add_simplex(nodes, id=name)
        orientations[name] = _odd(nodes)
    return simplices, orientations


def _odd(nodes: list[int]) -> int:
    """Return 0 if an even number of swaps sorts two or three nodes, otherwise 1."""
    return sum(a > b for i, a in enumerate(nodes) for b in nodes[i + 1 :]) % 2


def _sparse(what: str, matrix: Any) -> Any:
    """Return a matrix, dense or sparse, as a COO array of floats without zeros."""
    from scipy.sparse import coo_array

    if np.iscomplexobj(matrix):
        raise BadInput(f"{what} holds complex numbers: weights must be real")
    try:
        found = coo_array(matrix, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{what} is no matrix of numbers: {error}") from None
    if len(found.shape) != 2:
        raise BadInput(f"{what} has shape {found.shape}: a matrix has two dimensions")
    found.sum_duplicates()
    found.eliminate_zeros()
    return found


def _number(weight: str, edge: tuple[Any, Any, Mapping[str, Any]]) -> float:
    a, b, data = edge
    try:
        return float(data.get(weight, 1.0))
    except (TypeError, ValueError):
        raise BadInput(
            f"{weight} of the edge {a} - {b} is {data[weight]!r}: not a number"
        ) from None


def _groups(labels: list[Any]) -> Array | Integers | None:
    """Return whole numbers as they are, and other labels numbered in their sorted order."""
    if any(label is None for label in labels) or not labels:
        return None
    if all(isinstance(label, int | np.integer) for label in labels):
        return np.array(labels)
    place = {label: index for index, label in enumerate(sorted(set(map(str, labels))))}
    return np.array([place[str(label)] for label in labels])
