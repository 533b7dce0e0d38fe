"""Classes of runs, and the class of further runs, as a scikit-learn clusterer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.classification import classify
from chimera_hpc.classify.classifiers import Classifier
from chimera_hpc.classify.naming import TRIPLET
from chimera_hpc.classify.tree import Linkage
from chimera_hpc.measures.checks import floats


class ChimeraClasses(ClusterMixin, BaseEstimator):  # type: ignore[misc, unused-ignore]
    """Classes of total variations, as a sweep's reduction makes them.

    X is an array (runs, columns), usually the triplets of `TotalVariation`; each column is scaled
    to [0, 1]. A run with a missing number has no class.

    Parameters
    ----------
    n : int
        Number of classes; HDBSCAN finds its own.
    names : "letters", "triplet", or sequence of str
        A, B, C, ... with the largest first; the paper's rule for ordered, chimera and disordered,
        which holds for its model on its ring; or names by rising values of the first column.
    classifier : {"agglomerative", "kmeans", "mixture", "hdbscan"}
    linkage : {"ward", "average", "complete"}
        Of the tree.
    least : float or array_like, shape (columns,)
        Smallest range of a column that is stretched to [0, 1]: noise of a column that is smaller
        makes no classes then.

    Attributes
    ----------
    labels_ : array of int, shape (runs,)
        Position of each run's class in `names_`; -1 for none.
    names_ : tuple of str
    scaler_ : array, shape (2, columns)
        What is scaled to 0 and 1: the smallest and the largest value of each column, or `least`
        above the smallest.
    atlas_ : Atlas
        The runs in scaled space, by which `predict` judges.
    """

    def __init__(
        self,
        n: int = 3,
        *,
        names: str | Sequence[str] = "letters",
        classifier: Classifier = "agglomerative",
        linkage: Linkage = "ward",
        least: float | ArrayLike = 0.0,
    ) -> None:
        self.n = n
        self.names = names
        self.classifier = classifier
        self.linkage = linkage
        self.least = least

    def fit(self, X: Any, y: Any = None) -> Self:
        """Cluster runs (runs, columns)."""
        points = self._checked(X, reset=True)
        if self.names == TRIPLET and points.shape[1] != 3:
            raise BadInput(f'names = "triplet" is for V_theta, V_a, V_Omega, not {points.shape[1]}')
        least = floats("least", self.least)
        if least.shape not in ((), (points.shape[1],)) or not (least >= 0.0).all():
            raise BadInput(f"least = {self.least!r}: one number >= 0, or one for each column")
        known = np.asarray(np.isfinite(points).all(axis=1))
        made = classify(
            np.where(known[:, None], points, np.nan),
            np.where(known, Status.DONE, Status.STEADY),
            linkage=self.linkage,
            classifier=self.classifier,
            cuts=(self.n,),
            names=self.names,
            least=least,
        )
        cut = made.cuts[self.n]
        self.labels_, self.names_, self.atlas_ = cut.labels, cut.names, Atlas.of(made, cut)
        self.scaler_ = made.scaler
        return self

    def predict(self, X: Any) -> NDArray[np.int64]:
        """Return the class of the nearest of the fitted runs for each run, -1 for none."""
        check_is_fitted(self)
        return self.atlas_.classify(self._checked(X, reset=False)).label

    def _checked(self, X: Any, reset: bool) -> NDArray[np.float64]:
        points: NDArray[np.float64] = validate_data(
            self, X, reset=reset, dtype=np.float64, ensure_all_finite="allow-nan"
        )
        return points

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags
