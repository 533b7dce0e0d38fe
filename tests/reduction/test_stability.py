"""Warnings of trees of a sample, and of cuts between two nearly equal merges."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import LARGEST_TREE, Classification, classify
from chimera_hpc.reduction.stability import counted, tree_warnings


def of_line(
    values: list[float], cuts: tuple[int, ...], largest: int | None = None
) -> Classification:
    triplets = np.array(values)[:, None] * np.ones(3)
    status = np.full(len(values), int(Status.DONE))
    return classify(triplets, status, cuts=cuts, linkage="average", largest_tree=largest)


@pytest.mark.parametrize(
    ("width", "unstable"), [(1.0, True), (1.019, True), (1.03, False), (1.5, False)]
)
def test_cut_between_nearly_equal_merges_is_unstable(width: float, unstable: bool) -> None:
    # Pairs of width 1 and `width`: the cut into 3 splits one of them and not the other.
    made = of_line([0.0, 1.0, 10.0, 10.0 + width], (1, 2, 3, 4))
    lines = tree_warnings(made)
    assert len(lines) == unstable
    assert all("the cut into 3 clusters is unstable" in line for line in lines)


def test_tree_of_a_sample_is_said() -> None:
    values = [float(k) ** 2 for k in range(40)]
    assert tree_warnings(of_line(values, (2,))) == []
    (line,) = tree_warnings(of_line(values, (2,), largest=5))
    assert "of 40 runs" in line
    assert "sample of" in line


def test_nothing_to_warn_of_without_runs() -> None:
    assert tree_warnings(of_line([], (3,))) == []
    assert tree_warnings(of_line([1.0, 1.0], (3,))) == []


def test_hundred_thousand_runs_are_in_one_tree() -> None:
    assert LARGEST_TREE["ward"] == 100_000


@pytest.mark.parametrize(
    ("cuts", "names", "said"),
    [((3, 4), "letters", True), ((2, 3), "letters", False), ((3,), "triplet", False)],
)
def test_a_number_of_classes_that_no_cut_has_is_said(
    cuts: tuple[int, ...], names: str, said: bool
) -> None:
    rng = np.random.default_rng(0)
    triplets = np.repeat([0.0, 1.0], 20)[:, None] + 0.05 * rng.normal(size=(40, 3))
    made = classify(triplets, np.full(40, int(Status.DONE)), cuts=cuts, names=names)
    lines = counted(triplets, made)
    assert len(lines) == said
    for line in lines:
        assert line.startswith("40 of 40 runs look like 2 classes (")
        assert line.endswith(", and no cut has so many: add 2 to reduction.cuts")
