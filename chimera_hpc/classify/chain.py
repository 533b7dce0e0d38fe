"""Ward's tree in linear memory, from chains of nearest neighbours.

In a chain, each cluster is the nearest neighbour of the one before it. Distances decrease along the
chain, so it ends with two clusters that are nearest to each other. These two merge at once. With
Ward's distance, a merge brings no other clusters nearer. The merges sorted by height are therefore
those of the tree in which the nearest pair merges first (F. Murtagh, Comput. J. 26(4), 1983;
D. Müllner, arXiv:1109.2378, fig. 3).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def ward(points: Floats) -> Floats:
    """Return SciPy's linkage matrix (m - 1, 4) of m >= 1 points by Ward's method.

    Clusters of s and t points with centroids x and y merge at the height
    ``sqrt(2 s t / (s + t)) |x - y|``. Takes O(m) memory and O(m^2) time.
    """
    first, group = np.unique(points, axis=0, return_index=True, return_inverse=True)[1:]
    one = first[group.ravel()]
    # Equal points merge at once: redrawn runs are a third copies.
    copies = np.flatnonzero(one != np.arange(len(points)))
    equal = [(int(one[copy]), int(copy), 0.0) for copy in copies]
    leaves = np.sort(first)
    sizes = np.bincount(one, minlength=len(points))[leaves]
    merges = _merges(_Clusters(points[leaves], sizes, leaves))
    return _number(equal + sorted(merges, key=lambda merge: merge[2]))


class _Clusters:
    """The remaining clusters in contiguous arrays: centroids, weights and one leaf of each."""

    def __init__(self, points: Floats, sizes: Integers, leaves: Integers) -> None:
        self.centroids = np.array(points.T, dtype=np.float64, order="C")
        """(n_columns, m)"""
        self.weights = 1.0 / sizes
        """One over the number of points."""
        self.leaves = leaves
        self.n = len(points)
        self._steps = np.empty_like(self.centroids)
        self._distances, self._sums = np.empty((2, self.n))

    def nearest(self, one: int, bound: float) -> tuple[int, float]:
        """Return the cluster nearest to `one` and its distance, or (-1, bound) if none is nearer.

        The distance, ``|x - y|^2 / (1/s + 1/t)``, has the same bits from either side.
        """
        n = self.n
        steps, found, sums = self._steps[:, :n], self._distances[:n], self._sums[:n]
        np.subtract(self.centroids[:, :n], self.centroids[:, one : one + 1], out=steps)
        np.multiply(steps, steps, out=steps)
        np.add.reduce(steps, axis=0, out=found)
        np.add(self.weights[:n], self.weights[one], out=sums)
        np.divide(found, sums, out=found)
        found[one] = np.inf
        other = int(found.argmin())
        distance = float(found[other])
        return (other, distance) if distance < bound else (-1, bound)

    def merge(self, one: int, other: int) -> None:
        """Replace `one` by the union and `other` by the last cluster."""
        share = self.weights[one] / (self.weights[one] + self.weights[other])
        # Equal centroids stay equal to the last bit.
        centroids = self.centroids
        centroids[:, one] += share * (centroids[:, other] - centroids[:, one])
        self.weights[one] *= 1.0 - share
        self.n -= 1
        centroids[:, other] = centroids[:, self.n]
        self.weights[other] = self.weights[self.n]
        self.leaves[other] = self.leaves[self.n]


def _merges(clusters: _Clusters) -> Iterator[tuple[int, int, float]]:
    """Yield (leaf, leaf, height) of each merge, in the order in which the chains find them."""
    chain, reach = [0], [np.inf]
    while clusters.n > 1:
        following, distance = clusters.nearest(chain[-1], reach[-1])
        if following >= 0:
            chain.append(following)
            reach.append(distance)
            continue
        one, other = chain[-2:]
        yield int(clusters.leaves[one]), int(clusters.leaves[other]), np.sqrt(2.0 * distance)
        clusters.merge(one, other)
        # The last cluster has moved to `other`.
        chain = [other if at == clusters.n else at for at in chain[:-2]] or [0]
        reach = reach[:-2] or [np.inf]


def _number(merges: list[tuple[int, int, float]]) -> Floats:
    """Return the linkage matrix of merges (leaf, leaf, height) that are sorted by height."""
    n_leaves = len(merges) + 1
    parent = list(range(2 * n_leaves - 1))
    size = [1] * n_leaves
    tree = np.empty((len(merges), 4))
    for row, (one, other, height) in enumerate(merges):
        low, high = sorted((_root(parent, one), _root(parent, other)))
        parent[low] = parent[high] = n_leaves + row
        size.append(size[low] + size[high])
        tree[row] = low, high, height, size[-1]
    return tree


def _root(parent: list[int], node: int) -> int:
    """Return the current cluster of `node`, and halve the path to it (path halving)."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node
