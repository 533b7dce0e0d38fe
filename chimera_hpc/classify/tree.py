"""A tree of merges (dendrogram): build it, cut it, and list its splits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.cluster import hierarchy
from scipy.spatial.distance import pdist

from chimera_hpc.classify import chain

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Linkage = Literal["ward", "average", "complete"]
LINKAGES: tuple[Linkage, ...] = ("ward", "average", "complete")
MOST_BY_SCIPY = 4_000
"""Most points for which SciPy builds Ward's tree; it then takes 64 MB."""


def limits(points: Floats, least: ArrayLike = 0.0) -> Floats:
    """Return the smallest and largest value of each column, shape (2, n_columns).

    They are at least `least` apart, which may be one number per column: smaller ranges, of noise,
    say, are then not stretched to those of other columns.
    """
    if len(points) == 0:
        return np.zeros((2, points.shape[1]))
    low, high = points.min(axis=0), points.max(axis=0)
    return np.stack([low, np.maximum(high, low + np.asarray(least, dtype=np.float64))])


def scale(points: Floats, scaler: Floats) -> Floats:
    """Scale each column linearly so that the limits `scaler` (2, n_columns) become 0 and 1.

    Equal to scikit-learn's ``MinMaxScaler``. A constant column becomes 0. Points outside the limits
    are not clipped.
    """
    span = scaler[1] - scaler[0]
    scaled: Floats = (points - scaler[0]) / np.where(span > 0.0, span, 1.0)
    return scaled


def grow(scaled: Floats, method: Linkage) -> Floats:
    """Return SciPy's linkage matrix (m - 1, 4) of m points; (0, 4) for fewer than two.

    Row i merges two clusters into cluster m + i at the height in column 2. Heights never decrease
    with ward, average and complete linkage. Time and memory are O(m^2). With Ward's method and more
    than `MOST_BY_SCIPY` points, memory is O(m).
    """
    if len(scaled) < 2:
        return np.empty((0, 4))
    if method == "ward" and len(scaled) > MOST_BY_SCIPY:
        return chain.ward(scaled)
    # Distances are passed, because SciPy may take a square array of points for distances.
    return np.asarray(hierarchy.linkage(pdist(scaled), method=method), dtype=np.float64)


def separable(tree: Floats) -> int:
    """Return the largest number of clusters that does not separate equal points."""
    return 1 + int(np.count_nonzero(tree[:, 2] > 0.0))


def clusters_at(tree: Floats, depth: float) -> int:
    """Return the number of clusters that a line at height `depth` cuts the tree into."""
    return 1 + int(np.count_nonzero(tree[:, 2] > depth))


def cut(tree: Floats, n_clusters: int) -> Integers:
    """Undo the last ``n_clusters - 1`` merges and number the clusters of the m leaves from 0.

    Clusters of a finer cut lie inside those of a coarser one. There are fewer clusters than
    requested if the tree has fewer different points.
    """
    n_leaves = len(tree) + 1
    owner = np.arange(2 * n_leaves - 1)
    children = tree[:, :2].astype(np.int64)
    kept = len(tree) - (min(n_clusters, separable(tree)) - 1)
    for row in range(kept - 1, -1, -1):
        owner[children[row]] = owner[n_leaves + row]
    return np.unique(owner[:n_leaves], return_inverse=True)[1].astype(np.int64)


def middle_height(tree: Floats, n_clusters: int) -> float:
    """Return a height that cuts the tree into `n_clusters`, halfway between two merges.

    For one cluster it is 1.05 times the height of the root.
    """
    heights = np.concatenate([[0.0], tree[:, 2]])
    undone = min(n_clusters, separable(tree)) - 1
    if undone == 0:
        return 1.05 * float(heights[-1])
    return 0.5 * float(heights[-1 - undone] + heights[-undone])


def relative_gap(tree: Floats, n_clusters: int) -> float:
    """Return ``1 - h_below / h_above`` of the merges just below and above a cut; 1 for one cluster.

    The cut undoes the merge at ``h_above`` and keeps the one at ``h_below``. If the two heights are
    nearly equal, a small change of the points exchanges them, and another cluster splits.
    """
    undone = min(n_clusters, separable(tree)) - 1
    if undone < 1:
        return 1.0
    heights = np.concatenate([[0.0], tree[:, 2]])
    return 1.0 - float(heights[-1 - undone] / heights[-undone])


@dataclass(frozen=True)
class Split:
    """A split as the depth threshold decreases: at `depth`, a cluster of class `name` splits."""

    depth: float
    n_clusters: int
    """Number of clusters after the split."""
    name: str
    """Class of the cluster in the starting cut."""
    sizes: tuple[int, int]
    """Number of leaves in the two parts, larger first."""


def splits_below(
    tree: Floats, leaf_labels: Integers, names: tuple[str, ...], until: int
) -> tuple[Split, ...]:
    """List the splits below the cut that gave `leaf_labels` (m,), down to `until` clusters."""
    n_leaves = len(tree) + 1
    size = np.concatenate([np.ones(n_leaves), tree[:, 3]]).astype(np.int64)
    first_leaf = np.arange(2 * n_leaves - 1)
    children = tree[:, :2].astype(np.int64)
    for row in range(len(tree)):
        first_leaf[n_leaves + row] = first_leaf[children[row, 0]]
    found = []
    for n_clusters in range(max(len(names), 1) + 1, min(until, separable(tree)) + 1):
        row = len(tree) - (n_clusters - 1)
        parts = sorted((int(size[child]) for child in children[row]), reverse=True)
        name = names[leaf_labels[first_leaf[n_leaves + row]]]
        found.append(Split(float(tree[row, 2]), n_clusters, name, (parts[0], parts[1])))
    return tuple(found)
