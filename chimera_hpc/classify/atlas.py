"""An atlas: a finished classification that is kept to classify new runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from chimera_hpc.classify import tree
from chimera_hpc.classify.classification import Classification, Cut
from chimera_hpc.classify.tree import Floats, Integers

UNCLASSIFIED = "unclassified"
Variable = tuple[tuple[str, ...], NDArray[Any]]
"""Names of the dimensions, and values, as xarray accepts a variable."""


class Judgement(NamedTuple):
    """Classes of n triplets by an atlas."""

    label: Integers
    """(n,): class, -1 where the triplet is not finite."""
    name: list[str]
    distance: Floats
    """(n,): distance to the nearest training point in scaled space; NaN without a class."""


@dataclass(frozen=True)
class Atlas:
    """Training points in scaled space with their classes."""

    scaler: Floats
    """(2, 3): smallest and largest training triplets, which are scaled to 0 and 1."""
    points: Floats
    """(m, 3): training points, scaled."""
    labels: Integers
    """(m,): class of each training point."""
    names: tuple[str, ...]

    @property
    def sizes(self) -> Integers:
        """(n_classes,): training points of each class."""
        return np.bincount(self.labels, minlength=len(self.names))

    @classmethod
    def of(cls, classification: Classification, cut: Cut | None = None) -> Atlas:
        """Return the atlas of one cut (default: the base cut) over the leaves of the tree."""
        kept = classification.base if cut is None else cut
        labels = kept.labels[classification.members]
        return cls(classification.scaler, classification.scaled, labels, kept.names)

    def classify(self, triplets: ArrayLike) -> Judgement:
        """Give each triplet (n, 3) the class of the nearest training point.

        The triplet is scaled by the training limits (it may fall outside [0, 1]^3), and the
        Euclidean distance decides. Hierarchical clusters have neither a centre nor a border. With
        the nearest-point rule, each training point gets its own class. The distance measures the
        reliability of a class: it is 0 at a training point, and a class is not reliable if the
        distance is as large as that between two classes.
        """
        values = np.asarray(triplets, dtype=np.float64).reshape(-1, self.points.shape[1])
        label = np.full(len(values), -1, dtype=np.int64)
        distance = np.full(len(values), np.nan)
        usable = np.isfinite(values).all(axis=1)
        if usable.any() and len(self.points):
            scaled = tree.scale(values[usable], self.scaler)
            distance[usable], nearest = cKDTree(self.points).query(scaled)
            label[usable] = self.labels[nearest]
        name = [self.names[i] if i >= 0 else UNCLASSIFIED for i in label]
        return Judgement(label, name, distance)

    def variables(self) -> tuple[dict[str, Variable], dict[str, Any]]:
        """Return the arrays with their dimensions, and the JSON attributes, that a store keeps."""
        return {
            "atlas_scaler": (("limit", "variation"), self.scaler),
            "atlas_points": (("leaf", "variation"), self.points),
            "atlas_labels": (("leaf",), self.labels),
        }, {"atlas_names": list(self.names)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> Atlas:
        """Rebuild an atlas from the arrays and attributes of `variables`; others are ignored."""
        return cls(
            scaler=np.asarray(arrays["atlas_scaler"], dtype=np.float64),
            points=np.asarray(arrays["atlas_points"], dtype=np.float64),
            labels=np.asarray(arrays["atlas_labels"], dtype=np.int64),
            names=tuple(attributes["atlas_names"]),
        )
