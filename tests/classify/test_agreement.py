from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.classify.agreement import classes_by_incoherence, confusion


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
