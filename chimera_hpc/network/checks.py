"""Checks of the parts of a network; each error names the first link, node or triangle at fault."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_NODES = 2 * 10**9
"""Pairs of nodes are numbered in 64 bits."""


def node_count(n_nodes: Any) -> int:
    """Return a number of nodes as an int. Raises BadInput unless it is whole and at least 1."""
    count = int(n_nodes) if isinstance(n_nodes, int | float | np.number) else 0
    if count != n_nodes or not 1 <= count <= MOST_NODES:
        raise BadInput(f"n_nodes = {n_nodes}: allowed are whole numbers from 1 to {MOST_NODES}")
    return count


def frozen(values: ArrayLike, dtype: Any) -> NDArray[Any]:
    """Return the values as a read-only array of their own."""
    array: NDArray[Any] = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def whole(what: str, values: ArrayLike, columns: int) -> Integers:
    """Return rows of node numbers, shape (n, columns), as integers."""
    try:
        array = np.asarray(values)
        if array.size == 0:
            return np.empty((0, columns), dtype=np.int64)
        with np.errstate(invalid="ignore"):
            found = array.astype(np.int64)
        same = bool((found == array).all())
    except (TypeError, ValueError, OverflowError):
        same = False
    if not same or array.ndim != 2 or array.shape[1] != columns:
        raise BadInput(f"{what} must be whole numbers of shape (n, {columns})")
    return found


def checked_links(n_nodes: int, links: ArrayLike, directed: bool = False) -> Integers:
    """Return links as integers, shape (N1, 2). A pair of nodes has at most one link."""
    found = whole("links", links, 2)
    outside = (found.min(axis=1, initial=0) < 0) | (found.max(axis=1, initial=0) >= n_nodes)
    if outside.any():
        raise BadInput(f"{_link(found, outside)}: allowed are nodes 0 to {n_nodes - 1}")
    loops = found[:, 0] == found[:, 1]
    if loops.any():
        raise BadInput(f"{_link(found, loops)}: a link joins two different nodes")
    keys = found[:, 0] * n_nodes + found[:, 1] if directed else pair_keys(n_nodes, found)
    _refuse_repeated(keys, "link", found)
    return found


def checked_weights(weights: ArrayLike, n_links: int) -> Array:
    """Return the weights of links, shape (N1,). They must be finite."""
    try:
        found = np.asarray(weights, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadInput(f"weights must be real numbers: {error}") from None
    if found.shape != (n_links,):
        raise BadInput(f"weights have shape {found.shape}: expected is ({n_links},), one per link")
    wrong = ~np.isfinite(found)
    if wrong.any():
        index = int(np.argmax(wrong))
        raise BadInput(f"the weight of link {index} is {found[index]}: weights must be finite")
    return found


def checked_triangles(n_nodes: int, triangles: ArrayLike, links: Integers) -> Integers:
    """Return triangles as integers, shape (N2, 3). Every side must be a link."""
    found = whole("triangles", triangles, 3)
    known = np.sort(pair_keys(n_nodes, links))
    for a, b in ((0, 1), (1, 2), (0, 2)):
        sides = found[:, [a, b]]
        missing = ~np.isin(pair_keys(n_nodes, sides), known) | (sides[:, 0] == sides[:, 1])
        if missing.any():
            index = int(np.argmax(missing))
            nodes = ", ".join(map(str, found[index].tolist()))
            tail, head = sides[index].tolist()
            raise BadInput(
                f"triangle {index} (nodes {nodes}): there is no link between {tail} and {head}"
            )
    _, keys = np.unique(np.sort(found, axis=1), axis=0, return_inverse=True)
    _refuse_repeated(keys.ravel(), "triangle", found)
    return found


def checked_labels(what: str, labels: ArrayLike, n_nodes: int) -> Integers:
    """Return one whole number per node, shape (N0,)."""
    found = np.asarray(labels)
    if found.shape != (n_nodes,):
        raise BadInput(f"{what} have shape {found.shape}: expected is ({n_nodes},), one per node")
    return whole(what, found[:, None], 1)[:, 0]


def checked_order(order: ArrayLike, n_nodes: int) -> Integers:
    """Return an order of the nodes, shape (N0,): every node once."""
    found = checked_labels("order", order, n_nodes)
    missing = np.setdiff1d(np.arange(n_nodes), found)
    if len(missing):
        raise BadInput(
            f"order: node {missing[0]} is missing; an order names each of the nodes "
            f"0 to {n_nodes - 1} once"
        )
    return found


def check_indices(what: str, indices: ArrayLike, count: int) -> None:
    """Raise BadInput unless all indices are in 0 .. count - 1."""
    wrong = np.setdiff1d(indices, np.arange(count))
    if len(wrong):
        raise BadInput(f"{what} {wrong[0]}: allowed is 0 to {count - 1}")


def pair_keys(n_nodes: int, pairs: Integers) -> Integers:
    """Return one number per pair of nodes that does not depend on which comes first, shape (n,)."""
    keys: Integers = pairs.min(axis=1) * n_nodes + pairs.max(axis=1)
    return keys


def _link(links: Integers, wrong: Any) -> str:
    index = int(np.argmax(wrong))
    tail, head = links[index].tolist()
    return f"link {index} from node {tail} to node {head}"


def _refuse_repeated(keys: Integers, what: str, rows: Integers) -> None:
    _, first, place = np.unique(keys, return_index=True, return_inverse=True)
    again = first[place] != np.arange(len(keys))
    if again.any():
        index = int(np.argmax(again))
        nodes = ", ".join(map(str, rows[index].tolist()))
        earlier = int(first[place[index]])
        raise BadInput(
            f"{what} {index} (nodes {nodes}) repeats {what} {earlier}: give each {what} once"
        )
