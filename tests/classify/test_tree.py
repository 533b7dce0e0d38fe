from __future__ import annotations

import numpy as np
import pytest
from scipy.cluster import hierarchy
from sklearn.cluster import AgglomerativeClustering
from sklearn.metrics import adjusted_rand_score
from sklearn.preprocessing import MinMaxScaler

from chimera_hpc.classify import tree

# Four points on a line, merged at heights 1, 2 and then 8 or so: 0, 1 | 10, 12.
LINE = np.array([[0.0, 0, 0], [1.0, 0, 0], [10.0, 0, 0], [12.0, 0, 0]])


@pytest.fixture
def cloud() -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.concatenate([rng.normal(c, 0.4, (30, 3)) for c in (0.0, 2.0, 3.5)])


def test_scaling_equals_min_max_scaler_of_scikit_learn(cloud: np.ndarray) -> None:
    cloud[:, 1] = 0.25  # a constant column
    scaled = tree.scale(cloud, tree.limits(cloud))
    np.testing.assert_allclose(scaled, MinMaxScaler().fit_transform(cloud), atol=1e-15)
    assert scaled[:, 0].min() == 0.0
    assert scaled[:, 0].max() == 1.0


def test_scaling_does_not_clip_new_points() -> None:
    scaler = np.array([[0.0, 0, 0], [2.0, 2, 2]])
    np.testing.assert_array_equal(tree.scale(np.array([[4.0, -2, 1]]), scaler), [[2.0, -1, 0.5]])


@pytest.mark.parametrize("method", tree.LINKAGES)
@pytest.mark.parametrize("k", [1, 2, 3, 4, 5, 9])
def test_cut_equals_agglomerative_clustering_of_scikit_learn(
    cloud: np.ndarray, method: tree.Linkage, k: int
) -> None:
    labels = tree.cut(tree.grow(cloud, method), k)
    twin = AgglomerativeClustering(n_clusters=k, linkage=method).fit_predict(cloud)
    assert adjusted_rand_score(labels, twin) == 1.0
    assert set(labels) == set(range(k))


def test_cut_into_each_number_of_clusters_by_hand() -> None:
    grown = tree.grow(LINE, "average")
    np.testing.assert_allclose(grown[:, 2], [1.0, 2.0, 10.5])
    parts = [
        {tuple(np.flatnonzero(cut == c)) for c in set(cut)}
        for cut in (tree.cut(grown, k) for k in (1, 2, 3, 4, 7))
    ]
    assert parts[0] == {(0, 1, 2, 3)}
    assert parts[1] == {(0, 1), (2, 3)}
    assert parts[2] == {(0, 1), (2,), (3,)}
    assert parts[3] == parts[4] == {(0,), (1,), (2,), (3,)}


def test_cut_never_parts_equal_points() -> None:
    points = np.repeat([[0.0, 0, 0], [1.0, 1, 1]], 5, axis=0)
    grown = tree.grow(points, "ward")
    assert tree.separable(grown) == 2
    labels = tree.cut(grown, 4)
    assert len(set(labels)) == 2
    assert len(set(labels[:5])) == 1


@pytest.mark.parametrize("depth", [0.5, 1.0, 1.5, 2.0, 5.0, 10.5, 20.0])
def test_depth_cut_equals_the_distance_cut_of_scipy(depth: float) -> None:
    grown = tree.grow(LINE, "average")
    labels = tree.cut(grown, tree.clusters_at(grown, depth))
    twin = hierarchy.fcluster(grown, depth, criterion="distance")
    assert adjusted_rand_score(labels, twin) == 1.0


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_line_at_middle_height_makes_the_cut_it_stands_for(k: int) -> None:
    grown = tree.grow(LINE, "average")
    assert tree.clusters_at(grown, tree.middle_height(grown, k)) == k


def test_middle_heights_by_hand() -> None:
    grown = tree.grow(LINE, "average")
    assert tree.middle_height(grown, 2) == pytest.approx(6.25)
    assert tree.middle_height(grown, 3) == pytest.approx(1.5)
    assert tree.middle_height(grown, 4) == pytest.approx(0.5)
    assert tree.middle_height(grown, 1) == pytest.approx(1.05 * 10.5)


def test_relative_gaps_by_hand() -> None:
    grown = tree.grow(LINE, "average")  # merges at 1, 2 and 10.5
    gaps = [tree.relative_gap(grown, k) for k in (1, 2, 3, 4, 9)]
    assert gaps == pytest.approx([1.0, 1.0 - 2.0 / 10.5, 0.5, 1.0, 1.0])


def test_splits_below_name_the_class_that_parts() -> None:
    grown = tree.grow(LINE, "average")
    labels = tree.cut(grown, 2)
    names = tuple("near" if label == labels[0] else "far" for label in (0, 1))
    splits = tree.splits_below(grown, labels, names, until=9)
    assert [(s.name, s.n_clusters, s.sizes) for s in splits] == [
        ("far", 3, (1, 1)),
        ("near", 4, (1, 1)),
    ]
    np.testing.assert_allclose([s.depth for s in splits], [2.0, 1.0])


def test_sizes_of_parts_count_leaves_the_larger_first() -> None:
    grown = tree.grow(np.vstack([LINE, [[12.5, 0, 0]]]), "average")  # 0, 1 | 10, (12, 12.5)
    splits = tree.splits_below(grown, np.zeros(5, dtype=np.int64), ("all",), until=4)
    assert [s.sizes for s in splits] == [(3, 2), (2, 1), (1, 1)]


@pytest.mark.parametrize("n", [0, 1])
def test_tree_of_no_or_one_point_has_no_merge(n: int) -> None:
    grown = tree.grow(np.zeros((n, 3)), "ward")
    assert grown.shape == (0, 4)
    assert tree.separable(grown) == 1
    assert tree.clusters_at(grown, 1.0) == 1
    assert tree.middle_height(grown, 3) == 0.0
