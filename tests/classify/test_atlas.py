from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.classify.atlas import UNCLASSIFIED, Atlas
from chimera_hpc.classify.classification import classify

# Two near (ordered), one far in V_Omega (chimera), one far in V_theta (disordered).
POINTS = np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.2, 0.5, 1.0], [2.0, 0.0, 0.0]])


@pytest.fixture
def atlas() -> Atlas:
    return Atlas.of(classify(POINTS, np.ones(4)))


def test_training_points_get_their_own_class_at_distance_zero(atlas: Atlas) -> None:
    judged = atlas.classify(POINTS)
    assert judged.name == ["ordered", "ordered", "chimera", "disordered"]
    assert [atlas.names[i] for i in judged.label] == judged.name
    np.testing.assert_array_equal(judged.distance, 0.0)


def test_distance_is_measured_in_scaled_space(atlas: Atlas) -> None:
    # V_theta spans 2, V_a 0.5, V_Omega 1: this point is half a span from (2, 0, 0) in V_theta.
    judged = atlas.classify([[3.0, 0.0, 0.0]])
    assert judged.name == ["disordered"]
    np.testing.assert_allclose(judged.distance, 0.5)


def test_nearest_point_decides_and_not_the_nearest_centroid() -> None:
    # Beyond the far end of a long ordered class, the disordered centroid is nearer than its own.
    long = [[x, 0.0, 0.0] for x in np.linspace(0.0, 1.0, 21)]
    points = np.array([*long, [0.5, 0.0, 1.0], [1.6, 0.0, 0.0]])
    atlas = Atlas.of(classify(points, np.ones(len(points)), linkage="average"))
    assert atlas.classify(points).name == ["ordered"] * 21 + ["chimera", "disordered"]
    assert atlas.classify([[1.15, 0.0, 0.0]]).name == ["ordered"]


def test_triplets_that_are_not_finite_get_no_class(atlas: Atlas) -> None:
    judged = atlas.classify([[np.nan, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, np.inf, 0.0]])
    assert judged.name == [UNCLASSIFIED, "disordered", UNCLASSIFIED]
    assert judged.label.tolist() == [-1, atlas.names.index("disordered"), -1]
    np.testing.assert_array_equal(np.isnan(judged.distance), [True, False, True])


def test_atlas_survives_storing(atlas: Atlas) -> None:
    variables, attributes = atlas.variables()
    for dimensions, values in variables.values():
        assert len(dimensions) == values.ndim
        assert values.dtype.kind in "if"
    arrays = {name: values for name, (_, values) in variables.items()} | {"other": np.zeros(1)}
    back = Atlas.from_arrays(arrays, attributes)
    probe = np.random.default_rng(0).random((50, 3)) * 2.0
    for one, other in zip(atlas.classify(probe), back.classify(probe), strict=True):
        np.testing.assert_array_equal(one, other)


def test_atlas_can_keep_a_finer_cut() -> None:
    result = classify(POINTS, np.ones(4), cuts=(4,))
    judged = Atlas.of(result, result.cuts[4]).classify(POINTS)
    assert judged.name == ["ordered-2", "ordered-1", "chimera", "disordered"]


def test_atlas_without_training_points_classifies_nothing() -> None:
    atlas = Atlas.of(classify(np.empty((0, 3)), np.empty(0)))
    assert atlas.classify([[0.1, 0.1, 0.1]]).name == [UNCLASSIFIED]


def test_a_tie_gives_one_of_the_nearest_runs_and_the_same_one_each_time() -> None:
    """On a lattice most triplets are equally far from several runs, each of its own class."""
    rng = np.random.default_rng(7)
    points, asked = rng.integers(0, 4, (60, 3)) / 4.0, rng.integers(0, 8, (40, 3)) / 8.0
    unit = np.array([[0.0] * 3, [1.0] * 3])
    atlas = Atlas(unit, points, np.arange(60), tuple(map(str, range(60))))
    judged = atlas.classify(asked)
    distances = np.linalg.norm(asked[:, None] - points[None], axis=2)
    nearest = np.isclose(distances, distances.min(axis=1, keepdims=True), rtol=0, atol=1e-12)
    assert (nearest.sum(axis=1) > 1).sum() > 10
    assert nearest[np.arange(40), judged.label].all()
    assert judged.distance == pytest.approx(distances.min(axis=1), abs=1e-12)
    stored, attributes = atlas.variables()
    back = Atlas.from_arrays({name: values for name, (_, values) in stored.items()}, attributes)
    assert [int(back.classify(one).label[0]) for one in asked] == judged.label.tolist()
