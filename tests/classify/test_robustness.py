from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from chimera_hpc.classify.robustness import fraction_curve, wilson_interval


@pytest.mark.parametrize("confidence", [0.9, 0.95])
@pytest.mark.parametrize(("hits", "trials"), [(0, 10), (3, 10), (10, 10), (1, 1), (480, 1000)])
def test_interval_equals_that_of_scipy(hits: int, trials: int, confidence: float) -> None:
    twin = binomtest(hits, trials).proportion_ci(confidence, method="wilson")
    low, high = wilson_interval(hits, trials, confidence)
    np.testing.assert_allclose([low, high], [twin.low, twin.high], atol=1e-12)


def test_interval_without_trials_is_everything() -> None:
    low, high = wilson_interval([0], [0])
    assert (low[0], high[0]) == (0.0, 1.0)


def test_ends_are_exact_at_zero_and_one() -> None:
    trials = np.arange(1, 300)
    assert (wilson_interval(0 * trials, trials)[0] == 0.0).all()
    assert (wilson_interval(trials, trials)[1] == 1.0).all()


def test_curve_counts_hits_at_each_value() -> None:
    x = [10, 0, 0, 10, 5, 0]
    hit = [False, True, True, True, False, False]
    curve = fraction_curve(x, hit)
    np.testing.assert_array_equal(curve.x, [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(curve.hits, [2, 0, 1])
    np.testing.assert_array_equal(curve.trials, [3, 1, 2])
    np.testing.assert_allclose(curve.fraction, [2 / 3, 0.0, 0.5])
    low, high = wilson_interval([2, 0, 1], [3, 1, 2])
    np.testing.assert_array_equal(curve.low, low)
    np.testing.assert_array_equal(curve.high, high)


def test_runs_without_result_are_left_out() -> None:
    curve = fraction_curve([0, 0, 5], [True, True, True], counted=[True, False, False])
    np.testing.assert_array_equal(curve.trials, [1, 0])
    assert curve.fraction[0] == 1.0
    assert np.isnan(curve.fraction[1])
    assert (curve.low[1], curve.high[1]) == (0.0, 1.0)


def test_curve_holds_until_the_first_value_below_the_level() -> None:
    x = np.repeat([0, 5, 10, 15], 2)
    curve = fraction_curve(x, [1, 1, 1, 1, 0, 1, 1, 1])
    assert curve.holds_until() == 5.0
    assert curve.holds_until(0.5) == 15.0
    assert fraction_curve([0, 1], [0, 1]).holds_until() is None


def test_curve_as_plain_lists() -> None:
    plain = fraction_curve([0, 0], [True, False]).to_dict()
    assert all(type(values) is list for values in plain.values())
    assert plain["fraction"] == [0.5]
    assert plain["trials"] == [2]
    assert set(plain) == {"x", "hits", "trials", "fraction", "low", "high"}
