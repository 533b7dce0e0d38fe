"""The upper part of a dendrogram: few enough leaves to be drawn, each a branch of many runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_LEAVES = 60


@dataclass(frozen=True)
class TreeTop:
    """The last merges of a tree over m leaves; n branches stand for those below."""

    xs: list[list[float]]
    ys: list[list[float]]
    """Corners of each bracket; branches stand at 0, 1, ... along x."""
    ends: list[list[int]]
    """First and last branch under each bracket."""
    sizes: list[int]
    """Runs in each branch."""
    members: NDArray[np.int64]
    """(n,) one leaf of the tree in each branch."""


def top_of(linkage: NDArray[np.float64], most: int = MOST_LEAVES) -> TreeTop:
    """Return the last `most` - 1 merges of SciPy's linkage matrix, branches from left to right."""
    n_leaves = len(linkage) + 1
    if n_leaves < 2:
        return TreeTop([], [], [], [], np.empty(0, dtype=np.int64))
    children = linkage[:, :2].astype(np.int64)
    first_row = max(0, len(linkage) - (most - 1))
    branches = _left_to_right(children, n_leaves, first_row)
    place = {node: float(i) for i, node in enumerate(branches)}
    ends = {node: [i, i] for i, node in enumerate(branches)}
    height = {node: 0.0 for node in branches}
    xs, ys, under = [], [], []
    for row in range(first_row, len(linkage)):
        left, right = sorted(children[row].tolist(), key=lambda node: place[node])
        node = n_leaves + row
        height[node] = float(linkage[row, 2])
        place[node] = 0.5 * (place[left] + place[right])
        ends[node] = [ends[left][0], ends[right][1]]
        xs.append([place[left], place[left], place[right], place[right]])
        ys.append([height[left], height[node], height[node], height[right]])
        under.append(ends[node])
    sizes = [1 if node < n_leaves else int(linkage[node - n_leaves, 3]) for node in branches]
    members = np.array([_any_leaf(children, n_leaves, node) for node in branches], np.int64)
    return TreeTop(xs, ys, under, sizes, members)


def _left_to_right(children: NDArray[np.int64], n_leaves: int, first_row: int) -> list[int]:
    """Return the nodes just below the kept merges, in an order without crossings."""
    branches, stack = [], [n_leaves + len(children) - 1]
    while stack:
        node = stack.pop()
        if node < n_leaves + first_row:
            branches.append(node)
        else:
            left, right = children[node - n_leaves].tolist()
            stack += [right, left]
    return branches


def _any_leaf(children: NDArray[np.int64], n_leaves: int, node: int) -> int:
    while node >= n_leaves:
        node = int(children[node - n_leaves, 0])
    return node
