"""The number of classes, and scikit-learn's classifiers, on clouds of which it is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.cluster import AgglomerativeClustering
from sklearn.metrics import adjusted_rand_score

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify import tree
from chimera_hpc.classify.class_number import ClassNumber, class_number
from chimera_hpc.classify.classification import classify
from chimera_hpc.classify.classifiers import OTHERS, Classifier, labels_by

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
    assert "; 1 lies apart (" in class_number(np.vstack([kinds(70), CENTRES[1:2]])).sentence


@pytest.mark.parametrize("sizes", [(20, 20), (14, 13, 13), (60, 8, 12)])
def test_kinds_are_counted(sizes: tuple[int, ...]) -> None:
    points = kinds(*sizes, seed=1)
    found = class_number(points)
    assert (found.answer, found.by_silhouette, found.by_stability) == (len(sizes),) * 3
    assert found.n_apart == 0
    shuffled = np.random.default_rng(5).permutation(points)
    np.testing.assert_array_equal(class_number(shuffled).stability, found.stability)


def test_clear_kinds_are_counted_where_the_gap_statistic_stops_at_one() -> None:
    rng = np.random.default_rng(7)
    sizes, means = [7, 6, 6], [[0.125, 0.01, 0.01], [0.36, 0.15, 0.085], [0.53, 0.01, 0.015]]
    widths = np.repeat([[0.001, 0.002, 0.003], [0.04, 0.05, 0.02], [0.05, 0.005, 0.004]], sizes, 0)
    found = class_number(np.repeat(means, sizes, axis=0) + widths * rng.normal(size=(19, 3)))
    assert (found.by_gap, found.answer) == (1, 3)
    assert "look like 3 classes (gap statistic 1, silhouette 3, stability 3)" in found.sentence


@pytest.mark.parametrize("n", [30, 72, 400])
def test_points_along_a_line_are_one_state_though_halves_are_apart(n: int) -> None:
    line = np.outer(np.linspace(0, 1, n), [0.5, 0.1, 0.1])
    found = class_number(line + 0.005 * np.random.default_rng(0).normal(size=line.shape))
    assert found.by_silhouette > 1
    assert (found.by_gap, found.answer) == (1, 1)


def test_remainders_of_one_state_are_no_classes_next_to_runs_apart() -> None:
    # as runs in phase, which differ by what is left of their starts, next to two chimeras
    rng = np.random.default_rng(0)
    left = np.repeat([[1e-5, 0.0, 0.0], [2e-4, 1e-4, 1e-4]], [50, 20], axis=0)
    points = np.vstack([left * rng.uniform(0.8, 1.2, (70, 1)), [[6e-3, 4e-3, 3e-3]] * 2])
    points[-1, 0] += 1e-3
    assert class_number(points[:70]).answer == 2
    assert class_number(points).sentence.startswith("70 of 72 runs look like one state; 2 lie ap")


def test_equal_points_are_one_state_and_two_values_two() -> None:
    assert class_number(np.ones((20, 3))).answer == 1
    assert class_number(np.repeat(CENTRES[:2], 20, axis=0)).answer == 2
    # half of the runs are equal: the others are no few runs apart
    assert class_number(np.vstack([np.zeros((40, 3)), kinds(0, 30)])).n_apart == 0


@pytest.mark.parametrize("ends", [([0.0], [1.0]), ([0.0, 1.0], [1.0, 0.0])])
def test_gap_by_hand_of_two_points_a_class(ends: tuple[list[float], list[float]]) -> None:
    found = class_number(np.repeat(np.array(ends), 2, axis=0))  # each equals its centroid
    assert len(found.gap) == 2
    np.testing.assert_array_equal(found.silhouette, [np.nan, 1.0])
    assert found.gap[1] > found.gap[0] + 100


@pytest.mark.parametrize(("error", "answer"), [([0.0, 0.2, 0.0], 1), ([0.2, 0.0, 0.0], 2)])
def test_gap_of_the_next_number_counts_less_its_own_error(error: list[float], answer: int) -> None:
    rest = np.array([np.nan, 0.5, 0.5])
    found = ClassNumber(np.array([1.0, 1.1, 0.9]), np.array(error), rest, rest, 20, 0)
    assert found.by_gap == answer


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


@pytest.mark.parametrize("classifier", OTHERS)
def test_classes_by_other_classifiers_have_the_same_names(classifier: Classifier) -> None:
    points = kinds(14, 13, 13)
    status = np.full(len(points), Status.DONE)
    by_tree = classify(points, status, cuts=(3,))
    found = classify(points, status, cuts=(3,), classifier=classifier)
    np.testing.assert_array_equal(found.cuts[3].labels, by_tree.cuts[3].labels)
    assert found.cuts[3].names == by_tree.cuts[3].names == ("ordered", "chimera", "disordered")
    assert found.order_of_splits() == ()
    shuffled = np.random.default_rng(2).permutation(len(points))
    again = classify(points[shuffled], status, cuts=(3,), classifier=classifier)
    np.testing.assert_array_equal(again.cuts[3].labels, found.cuts[3].labels[shuffled])


def test_hdbscan_may_leave_all_runs_without_a_class() -> None:
    points = np.random.default_rng(0).random((4, 3))
    found = classify(points, np.full(4, Status.DONE), classifier="hdbscan", cuts=(3,))
    assert found.cuts[3].names == ()
    assert (found.cuts[3].labels == -1).all()


def test_unknown_classifiers_are_refused_with_the_known_ones() -> None:
    with pytest.raises(BadInput, match="classifier is 'dbscan'; allowed: agglomerative, kmeans"):
        classify(np.zeros((2, 3)), [Status.DONE] * 2, classifier="dbscan")  # type: ignore[arg-type]
