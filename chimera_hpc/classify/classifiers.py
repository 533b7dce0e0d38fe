"""Classes of the same points by scikit-learn's clusterings, next to those of the tree."""

from __future__ import annotations

import warnings

import numpy as np

from chimera_hpc.classify.class_number import SMALLEST
from chimera_hpc.classify.tree import Floats, Integers

OTHERS = ("kmeans", "mixture", "hdbscan")
"""k-means, Gaussian mixture, and HDBSCAN, which finds the number of classes by itself."""


def labels_by(classifier: str, scaled: Floats, n_classes: int, seed: int = 0) -> Integers:
    """Return the class of each point, shape (n,), by one of `OTHERS`; -1 for none.

    Parameters
    ----------
    classifier : str
    scaled : (n, d) array
        Points scaled to [0, 1], at least two.
    n_classes : int
        Wanted number; fewer if there are fewer different points.
    seed : int
        Of the random starts; the same seed gives the same labels.
    """
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
        labels: Integers = makers[classifier]().fit_predict(scaled).astype(np.int64)
    return labels
