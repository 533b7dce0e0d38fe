from __future__ import annotations

import numpy as np

from chimera_hpc.classify.basin import basin_map


def test_fraction_of_runs_that_stay_inside() -> None:
    found = basin_map([2, 1, 1, 1, 2], [0.5, 0.5, 0.5, 1.0, 0.5], [1, 1, 0, 1, 1])
    np.testing.assert_array_equal(found.half_degree, [1, 2])
    np.testing.assert_array_equal(found.radius, [0.5, 1.0])
    np.testing.assert_array_equal(found.trials, [[2, 1], [2, 0]])
    np.testing.assert_array_equal(found.inside, [[1, 1], [2, 0]])
    np.testing.assert_allclose(found.fraction, [[0.5, 1.0], [1.0, np.nan]])


def test_runs_without_result_are_left_out() -> None:
    found = basin_map([1, 1], [0.5, 0.5], [False, True], counted=[False, True])
    np.testing.assert_array_equal(found.trials, [[1]])
    np.testing.assert_array_equal(found.fraction, [[1.0]])


def test_safe_radius_ends_at_the_first_loss() -> None:
    radius = np.tile([0.1, 0.2, 0.3], 3)
    half_degree = np.repeat([1, 2, 3], 3)
    found = basin_map(half_degree, radius, [1, 0, 1, 1, 1, 1, 0, 1, 1])
    np.testing.assert_array_equal(found.safe_radius(), [0.1, 0.3, np.nan])
