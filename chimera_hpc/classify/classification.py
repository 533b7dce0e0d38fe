"""From triplets of total variations to named classes (paper, sec. III C).

The triplets (V_theta, V_a, V_Omega) of all runs that have one are scaled to [0, 1] and merged
bottom-up into one tree. The tree is cut by number of clusters or at a depth threshold d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify import naming, tree
from chimera_hpc.classify.classifiers import (
    AGGLOMERATIVE,
    Classifier,
    check_classifier,
    labels_by,
)
from chimera_hpc.classify.tree import Floats, Integers, Split

TRIPLET = ("V_theta", "V_a", "V_Omega")
"""Names of the total variations, in the order of the columns of triplets."""

LARGEST_TREE: dict[tree.Linkage, int] = {"ward": 100_000, "average": 10_000, "complete": 10_000}
"""Most points in one tree. With Ward's linkage, triplets of a sweep take 20 s, and
evenly spread ones 70 s; the other linkages take 4 s and 0.8 GB."""

_BINS = 8


@dataclass(frozen=True)
class Cut:
    """The tree cut into k named classes, in the order of the base classes, then of suffixes."""

    labels: Integers
    """(n,): class of each point, -1 for points that were not clustered."""
    names: tuple[str, ...]
    families: tuple[str, ...]
    """Base class of each class: its name without the suffix."""
    centroids: Floats
    """(k, 3): mean of (V_theta, V_a, V_Omega), not scaled."""
    sizes: Integers
    """(k,): number of points."""
    depth: float
    """Height at which a line across the dendrogram makes this cut."""


@dataclass(frozen=True)
class Classification:
    """A tree over the clustered points and its cuts."""

    method: tree.Linkage
    linkage: Floats
    """(m - 1, 4): SciPy's linkage matrix over the m members."""
    members: Integers
    """(m,): index of the point behind each leaf of the tree."""
    scaler: Floats
    """(2, 3): smallest and largest V_theta, V_a, V_Omega of all clustered points."""
    scaled: Floats
    """(m, 3): the members in scaled space."""
    cuts: dict[int, Cut]
    """By the number of clusters asked for."""
    base: Cut
    """The cut whose classes the naming rule names directly. It may be missing from `cuts`."""
    depth: float | None
    """The requested depth threshold, if any. Its cut is in `cuts` by its number of clusters."""
    sampled: bool
    """Whether the tree holds a sample only. Other points have the label of the nearest leaf."""
    classifier: Classifier = AGGLOMERATIVE
    """What made the cuts; others than the tree make each cut for itself."""

    def order_of_splits(self, until: int = 8) -> tuple[Split, ...]:
        """Return which class splits at each step as the depth threshold decreases.

        None does with another classifier than the tree.
        """
        if self.classifier != AGGLOMERATIVE:
            return ()
        leaf_labels = self.base.labels[self.members]
        return tree.splits_below(self.linkage, leaf_labels, self.base.names, until)


def classify(
    triplets: ArrayLike,
    status: ArrayLike,
    *,
    linkage: tree.Linkage = "ward",
    classifier: Classifier = AGGLOMERATIVE,
    cuts: Sequence[int] = (3, 4, 5),
    depth: float | None = None,
    names: naming.Rule = "triplet",
    largest_tree: int | None = None,
    known: tuple[Floats, Integers] | None = None,
    least: ArrayLike = 0.0,
) -> Classification:
    """Cluster the points that have a triplet (see `has_triplet`) and name the clusters.

    Parameters
    ----------
    triplets : (n, 3) array
        V_theta, V_a, V_Omega; NaN where a point has none.
    status : (n,) integers
        `chimera_hpc.base.status.Status` of each point.
    linkage : {"ward", "average", "complete"}
    classifier : {"agglomerative", "kmeans", "mixture", "hdbscan"}
        What makes the classes: the tree, or one of `classifiers.OTHERS` on the scaled triplets. The
        tree is grown in any case. HDBSCAN finds the number of classes by itself, and gives some
        points none (label -1).
    cuts : numbers of clusters. Equal points stay in one cluster, so a cut may have fewer classes
        than requested (none if no run oscillates).
    depth : depth threshold d in scaled space: merges higher than d are undone.
    names : "triplet", "letters", or a list of names by increasing V_theta; see
        `naming.name_base`.
        Finer cuts inherit the names along the tree. A class that splits gets suffixes.
    largest_tree : largest number of points in the tree (default `LARGEST_TREE`). With more points,
        the tree is built from a deterministic sample of about that size: points are sorted by box
        of an 8 x 8 x 8 grid over scaled space and taken at equal steps, together with the first
        point of each box. Other points get the class of the nearest sampled point, and
        `Classification.sampled` is true.
    known : linkage and members of an earlier classification of the same points. The tree is then
        not built again.
    least : smallest range that is stretched to [0, 1], see `tree.limits`.

    Notes
    -----
    Points enter the tree in lexicographic order, so the classes do not depend on the order of the
    points.

    Raises
    ------
    BadInput
        Unknown linkage, classifier or naming rule, a number of clusters below 1, a depth that
        is not positive.
    ValueError
        A DONE point whose triplet is not finite.
    """
    _check(linkage, cuts, depth)
    check_classifier(classifier)
    base_size = naming.base_size(names, cuts)
    points = np.asarray(triplets, dtype=np.float64)
    points = points if points.ndim == 2 else points.reshape(-1, 3)
    clustered = np.flatnonzero(has_triplet(points, status))
    if not np.isfinite(points[clustered]).all():
        raise ValueError("a point with status DONE has a triplet that is not finite")
    scaler = tree.limits(points[clustered], least)
    scaled = tree.scale(points[clustered], scaler)
    if known is None:
        leaves = _sample(scaled, largest_tree or LARGEST_TREE[linkage])
        grown = tree.grow(scaled[leaves], linkage)
    else:
        grown, leaves = known[0], np.searchsorted(clustered, known[1])
    nearest = _nearest_leaf(scaled, leaves)
    by = scaled if classifier != AGGLOMERATIVE else None
    maker = _CutMaker(points, clustered, grown, nearest, names, base_size, classifier, by)
    wanted = {int(k): maker.make(int(k)) for k in cuts}
    if depth is not None:
        wanted[tree.clusters_at(grown, depth)] = maker.make(tree.clusters_at(grown, depth), depth)
    return Classification(
        method=linkage,
        linkage=grown,
        members=clustered[leaves],
        scaler=scaler,
        scaled=scaled[leaves],
        cuts=dict(sorted(wanted.items())),
        base=maker.make(base_size),
        depth=depth,
        sampled=len(leaves) < len(clustered),
        classifier=classifier,
    )


def has_triplet(triplets: Floats, status: ArrayLike) -> NDArray[np.bool_]:
    """Tell which points are clustered: those that are DONE, and other results with a triplet.

    Runs that do not oscillate have one if they are measured with steady = "level".
    """
    state = np.asarray(status)
    still = (state == Status.STEADY) | (state == Status.NO_WINDOW)
    found: NDArray[np.bool_] = (state == Status.DONE) | (still & np.isfinite(triplets).all(axis=1))
    return found


def _check(linkage: str, cuts: Sequence[int], depth: float | None) -> None:
    if linkage not in tree.LINKAGES:
        raise BadInput(f"reduction.linkage is {linkage!r}; allowed: {', '.join(tree.LINKAGES)}")
    if any(k < 1 for k in cuts):
        raise BadInput(f"reduction.cuts is {list(cuts)}; numbers of clusters start at 1")
    if depth is not None and not depth > 0.0:
        raise BadInput(f"reduction.depth is {depth}; it must be above 0")


def _sample(scaled: Floats, largest: int) -> Integers:
    """Return the rows that enter the tree. Their order depends on their values only."""
    order = np.lexsort(scaled.T[::-1])
    if len(order) <= largest:
        return order.astype(np.int64)
    boxes = np.minimum((scaled[order] * _BINS).astype(np.int64), _BINS - 1)
    box = boxes @ _BINS ** np.arange(scaled.shape[1])[::-1]
    by_box = np.argsort(box, kind="stable")
    steps = (np.arange(largest) + 0.5) * (len(order) / largest)
    first_of_box = np.unique(box[by_box], return_index=True)[1]
    chosen = by_box[np.union1d(steps.astype(np.int64), first_of_box)]
    return order[np.sort(chosen)].astype(np.int64)


def _nearest_leaf(scaled: Floats, leaves: Integers) -> Integers:
    """Return for each row its own leaf, or the nearest one if the row is not in the tree."""
    position = np.full(len(scaled), -1, dtype=np.int64)
    position[leaves] = np.arange(len(leaves))
    missing = np.flatnonzero(position < 0)
    if len(missing):
        position[missing] = cKDTree(scaled[leaves]).query(scaled[missing])[1]
    return position


@dataclass(frozen=True)
class _CutMaker:
    """Turns cuts of the tree into named cuts of all points."""

    points: Floats
    clustered: Integers
    tree: Floats
    nearest: Integers
    rule: naming.Rule
    base_size: int
    classifier: Classifier
    scaled: Floats | None
    """Scaled triplets of the clustered points, for another classifier than the tree."""

    def make(self, n_clusters: int, depth: float | None = None) -> Cut:
        labels = np.full(len(self.points), -1, dtype=np.int64)
        raw = self._labels(n_clusters) if len(self.clustered) else np.empty(0, dtype=np.int64)
        if raw.max(initial=-1) < 0:
            empty = np.empty((0, self.points.shape[1]))
            return Cut(labels, (), (), empty, np.empty(0, dtype=np.int64), depth or 0.0)
        centroids, sizes = self._centroids(raw)
        families, names, order = self._names(raw, centroids)
        rank = np.argsort(order)
        labels[self.clustered[raw >= 0]] = rank[raw[raw >= 0]]
        height = tree.middle_height(self.tree, n_clusters) if depth is None else depth
        return Cut(
            labels=labels,
            names=tuple(names[i] for i in order),
            families=tuple(families[i] for i in order),
            centroids=centroids[order],
            sizes=sizes[order],
            depth=height,
        )

    def _labels(self, n_clusters: int) -> Integers:
        if self.scaled is None:
            return tree.cut(self.tree, n_clusters)[self.nearest]
        return labels_by(self.classifier, self.scaled, n_clusters)

    def _centroids(self, labels: Integers) -> tuple[Floats, Integers]:
        known = labels >= 0
        members = self.points[self.clustered[known]]
        sizes = np.bincount(labels[known])
        sums = [np.bincount(labels[known], weights=column) for column in members.T]
        return np.stack(sums, axis=1) / sizes[:, None], sizes.astype(np.int64)

    def _names(self, labels: Integers, centroids: Floats) -> tuple[list[str], list[str], Integers]:
        base_labels = self._labels(self.base_size)
        base_centroids, sizes = self._centroids(base_labels)
        base_names = naming.name_base(base_centroids, self.rule, sizes)
        families = naming.inherit(base_labels, base_names, labels)
        names = naming.add_suffixes(families, centroids)
        known = naming.all_names(self.rule, self.base_size)
        keys = [(known.index(family), name) for family, name in zip(families, names, strict=True)]
        order = sorted(range(len(names)), key=lambda i: (keys[i][0], len(keys[i][1]), keys[i][1]))
        return families, names, np.array(order, dtype=np.int64)
