from __future__ import annotations

import numpy as np
import pytest
from scipy.cluster import hierarchy
from scipy.spatial.distance import pdist
from sklearn.metrics import adjusted_rand_score

from chimera_hpc.classify import chain, tree


def cloud(n: int, n_columns: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.random((n, n_columns)) + rng.integers(0, 4, (n, 1))


def scipys(points: np.ndarray) -> np.ndarray:
    return hierarchy.linkage(pdist(points), method="ward")


@pytest.mark.parametrize("n", [2, 3, 4, 17, 250, 1500])
@pytest.mark.parametrize("n_columns", [1, 3, 7])
def test_tree_equals_the_one_of_scipy(n: int, n_columns: int) -> None:
    points = cloud(n, n_columns, seed=n)
    grown, twin = chain.ward(points), scipys(points)
    np.testing.assert_array_equal(grown[:, [0, 1, 3]], twin[:, [0, 1, 3]])
    np.testing.assert_allclose(grown[:, 2], twin[:, 2], rtol=1e-12)


def test_equal_points_merge_at_zero_and_are_never_parted() -> None:
    places = cloud(40, 3, seed=5)
    points = places[np.random.default_rng(6).integers(0, 40, 300)]
    grown, twin = chain.ward(points), scipys(points)
    assert np.count_nonzero(grown[:, 2] == 0.0) == 300 - len(np.unique(points, axis=0))
    np.testing.assert_allclose(grown[:, 2], twin[:, 2], rtol=1e-12)
    for k in (2, 5, 20):
        assert adjusted_rand_score(tree.cut(grown, k), tree.cut(twin, k)) == 1.0


def test_tree_of_a_lattice_is_a_valid_tree_whose_merges_never_fall() -> None:
    # Many pairs are equally near: which of them merge first is a matter of choice.
    side = np.arange(7.0)
    grown = chain.ward(np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3))
    assert hierarchy.is_valid_linkage(grown)
    assert hierarchy.is_monotonic(grown)
    assert grown[-1, 3] == 7**3
    assert np.count_nonzero(grown[:, 2] == 1.0) >= 7**3 // 3


def test_points_stay_as_they_were() -> None:
    points = cloud(20, 3, seed=1)
    before = points.copy()
    chain.ward(points)
    np.testing.assert_array_equal(points, before)


def test_large_tree_is_grown_by_chains_and_equals_the_small_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = cloud(60, 3, seed=9)
    small = tree.grow(points, "ward")
    monkeypatch.setattr(tree, "MOST_BY_SCIPY", 59)
    monkeypatch.setattr(hierarchy, "linkage", None)
    np.testing.assert_allclose(tree.grow(points, "ward"), small, rtol=1e-12)
