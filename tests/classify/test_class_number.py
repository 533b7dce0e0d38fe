"""The number of classes, and scikit-learn's classifiers, on clouds of which it is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.cluster import AgglomerativeClustering
from sklearn.metrics import adjusted_rand_score

from chimera_hpc.classify import tree
from chimera_hpc.classify.class_number import class_number
from chimera_hpc.classify.classifiers import OTHERS, labels_by

Array = NDArray[np.float64]
CENTRES = np.array([[0.05, 0.01, 0.001], [0.3, 0.1, 0.11], [0.55, 0.02, 0.01]])


def kinds(*sizes: int, seed: int = 0) -> Array:
    """Triplets about the centres of ordered, chimera and disordered runs."""
    rng = np.random.default_rng(seed)
    centres = np.repeat(CENTRES[: len(sizes)], sizes, axis=0)
    return centres * (1 + 0.1 * rng.normal(size=centres.shape))


def test_one_state_of_seventy_runs_and_two_apart() -> None:
    found = class_number(np.vstack([kinds(70), CENTRES[1:]]))
    assert found.answer == found.by_silhouette == found.by_stability == 1
    assert found.sentence.startswith("70 of 72 runs look like one state; 2 lie apart (gap ")


@pytest.mark.parametrize("sizes", [(20, 20), (14, 13, 13), (60, 8, 12)])
def test_kinds_are_counted(sizes: tuple[int, ...]) -> None:
    points = kinds(*sizes, seed=1)
    found = class_number(points)
    assert (found.answer, found.by_silhouette, found.by_stability) == (len(sizes),) * 3
    assert found.n_apart == 0
    shuffled = np.random.default_rng(5).permutation(points)
    np.testing.assert_array_equal(class_number(shuffled).stability, found.stability)


def test_equal_points_are_one_state_and_two_values_two() -> None:
    assert class_number(np.ones((20, 3))).answer == 1
    assert class_number(np.repeat(CENTRES[:2], 20, axis=0)).answer == 2
    # half of the runs are equal: the others are no few runs apart
    assert class_number(np.vstack([np.zeros((40, 3)), kinds(0, 30)])).n_apart == 0


def test_gap_by_hand_of_two_points_a_class() -> None:
    found = class_number(np.array([[0.0], [0.0], [1.0], [1.0]]))
    assert len(found.gap) == 2
    np.testing.assert_array_equal(found.silhouette, [np.nan, 1.0])
    assert found.gap[1] > found.gap[0] + 100


@pytest.mark.parametrize("classifier", OTHERS)
def test_classifiers_find_three_kinds(classifier: str) -> None:
    points = kinds(14, 13, 13)
    scaled = tree.scale(points, tree.limits(points))
    labels = labels_by(classifier, scaled, 3)
    truth = np.repeat([0, 1, 2], [14, 13, 13])
    assert adjusted_rand_score(truth, labels) > 0.95
    np.testing.assert_array_equal(labels_by(classifier, scaled, 3), labels)
    own = tree.cut(tree.grow(scaled, "ward"), 3)
    assert adjusted_rand_score(own, AgglomerativeClustering(3).fit_predict(scaled)) == 1.0


def test_fewer_different_points_than_classes() -> None:
    for classifier in ("kmeans", "hdbscan"):
        labels = labels_by(classifier, np.repeat([[0.0], [1.0]], 6, axis=0), 3)
        assert len(set(labels.tolist())) == 2
