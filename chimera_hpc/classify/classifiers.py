"""Classes of the same points by scikit-learn's clusterings, next to those of the tree."""

from __future__ import annotations

import warnings
from typing import Literal, get_args

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.class_number import SMALLEST
from chimera_hpc.classify.tree import Floats, Integers

Classifier = Literal["agglomerative", "kmeans", "mixture", "hdbscan"]
AGGLOMERATIVE: Classifier = "agglomerative"
OTHERS: tuple[Classifier, ...] = ("kmeans", "mixture", "hdbscan")
"""k-means, Gaussian mixture, and HDBSCAN, which finds the number of classes by itself."""


def check_classifier(name: str) -> None:
    """Raise BadInput for the name of no classifier."""
    if name not in get_args(Classifier):
        allowed = ", ".join(get_args(Classifier))
        raise BadInput(f"reduction.classifier is {name!r}; allowed: {allowed}")


def labels_by(classifier: str, scaled: Floats, n_classes: int, seed: int = 0) -> Integers:
    """Return the class of each point, shape (n,), by one of `OTHERS`; -1 for none.

    The order of the points does not matter. A single point is a class.

    Parameters
    ----------
    classifier : str
    scaled : (n, d) array
        Points scaled to [0, 1].
    n_classes : int
        Wanted number; fewer if there are fewer different points.
    seed : int
        Of the random starts; the same seed gives the same labels.
    """
    if len(scaled) < 2:
        return np.zeros(len(scaled), dtype=np.int64)
    from sklearn.cluster import HDBSCAN, KMeans
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture

    k = min(n_classes, len(np.unique(scaled, axis=0)))
    smallest = max(3, int(np.ceil(SMALLEST * len(scaled))))
    makers = {
        "kmeans": lambda: KMeans(k, n_init=10, random_state=seed),
        "mixture": lambda: GaussianMixture(k, n_init=5, random_state=seed),
        "hdbscan": lambda: HDBSCAN(min(smallest, len(scaled)), copy=True),
    }
    with warnings.catch_warnings():
        # Fewer steps than full convergence do not move a class.
        warnings.simplefilter("ignore", ConvergenceWarning)
        order = np.lexsort(scaled.T[::-1])
        labels = np.empty(len(scaled), dtype=np.int64)
        labels[order] = makers[classifier]().fit_predict(scaled[order])
    # A mixture may leave a class without a point.
    present = np.unique(labels[labels >= 0])
    return np.where(labels >= 0, np.searchsorted(present, labels), -1)
