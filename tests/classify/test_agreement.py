from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from chimera_hpc.classify.agreement import (
    adjusted_rand,
    classes_by_incoherence,
    confusion,
    rand_index,
)
from chimera_hpc.classify.verdicts import RULES


def test_strength_of_incoherence_names_classes() -> None:
    names = classes_by_incoherence([0.0, 1e-9, 0.5, 1.0])
    assert names == ["ordered", "chimera", "chimera", "disordered"]


def test_confusion_counts_pairs_rows_first() -> None:
    first = ["ordered", "ordered", "chimera", "steady", None]
    second = ["ordered", "chimera", "chimera", "ordered", "ordered"]
    found = confusion(first, second)
    np.testing.assert_array_equal(found.counts, [[1, 1, 0], [0, 1, 0], [0, 0, 0]])
    assert found.agreement == pytest.approx(2 / 3)


def test_kappa_by_hand() -> None:
    # p_o = 0.7, p_e = 0.5 * 0.6 + 0.5 * 0.4 = 0.5.
    first = ["a"] * 25 + ["b"] * 25
    second = ["a"] * 20 + ["b"] * 5 + ["a"] * 10 + ["b"] * 15
    found = confusion(first, second, classes=("a", "b"))
    assert found.agreement == pytest.approx(0.7)
    assert found.kappa == pytest.approx(0.4)


def test_measures_without_runs_are_nan() -> None:
    found = confusion([], [])
    assert np.isnan(found.agreement)
    assert np.isnan(found.kappa)
    assert np.isnan(confusion(["ordered"], ["ordered"]).kappa)


def test_adjusted_rand_ignores_names_and_runs_without_a_class() -> None:
    first = ["a", "a", "b", "b", None, "a"]
    assert adjusted_rand(first, ["x", "x", "y", "y", "x", None]) == 1.0
    # of 6 pairs 3 and 2 are together, 1 by both, as by chance: 3 * 2 / 6
    assert adjusted_rand(["a", "a", "a", "b"], ["x", "x", "y", "y"]) == pytest.approx(0.0)
    assert np.isnan(adjusted_rand([None], ["x"]))


def test_rules_name_runs_by_one_number() -> None:
    rules = {rule.quantity: rule for rule in RULES}
    named = rules["plateau"].classes([1.0, 0.98, 0.11, 0.1, 0.02, np.nan])
    assert named == ["ordered", "chimera", "chimera", "disordered", "disordered", None]
    assert rules["acm"].classes([0.95, 0.94, 0.06, 0.05]) == [
        *("ordered", "chimera", "chimera", "disordered")
    ]
    assert "Kemeth et al. 2016" in rules["g0"].text


def test_rand_index_is_that_of_scikit_learn() -> None:
    draw = np.random.default_rng(0)
    for n, k in ((2, 2), (40, 3), (40, 1), (25, 25)):
        first, second = draw.integers(0, k, n), draw.integers(0, 3, n)
        assert rand_index(first, second) == pytest.approx(adjusted_rand_score(first, second))
