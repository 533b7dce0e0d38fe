from __future__ import annotations

from typing import Any

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Cut
from chimera_hpc.classify.modes import modal_classes, run_names

NAMES = ("ordered", "chimera", "disordered")
S, W, D, N, F = Status.STEADY, Status.NO_WINDOW, Status.DONE, Status.NEVER, Status.TIME_OUT


def cut_of(labels: Any, names: tuple[str, ...] = NAMES, sizes: Any = None) -> Cut:
    label = np.asarray(labels, dtype=np.int64)
    count = np.bincount(label[label >= 0], minlength=len(names)) if sizes is None else sizes
    families = tuple(name.split("-")[0] for name in names)
    return Cut(label, names, families, np.zeros((len(names), 3)), np.asarray(count), 1.0)


def one_cell(table: Any, labels: Any, status: Any, **options: Any) -> dict[str, Any]:
    (cell,) = modal_classes(
        table(np.full(len(labels), 7)), np.array(status), cut_of(labels, **options)
    )
    return cell


def test_cell_carries_coordinates_votes_and_entropy(table: Any) -> None:
    cell = one_cell(table, [1, 1, 1, 0], [D] * 4)
    assert cell == {
        "P": 7,
        "epsilon": 0.05,
        "class": "chimera",
        "oscillating": 1.0,
        "votes": {"ordered": 1, "chimera": 3},
        "entropy_bits": pytest.approx(0.8112781244591328),
    }
    assert type(cell["P"]) is int
    assert type(cell["epsilon"]) is float


def test_unanimous_cell_has_no_entropy(table: Any) -> None:
    cell = one_cell(table, [2] * 20, [D] * 20)
    assert cell["votes"] == {"disordered": 20}
    assert cell["entropy_bits"] == 0.0
    assert str(cell["entropy_bits"]) == "0.0"  # and not -0.0


def test_steady_runs_vote_but_do_not_decide(table: Any) -> None:
    cell = one_cell(table, [-1, -1, -1, 1], [S, S, S, D])
    assert cell["class"] == "chimera"
    assert cell["oscillating"] == 0.25
    assert cell["votes"] == {"chimera": 1, "steady": 3}


def test_runs_with_a_class_decide_even_if_they_do_not_oscillate(table: Any) -> None:
    cell = one_cell(table, [0, 0, 1, 0], [S, W, D, D])
    assert (cell["class"], cell["oscillating"]) == ("ordered", 0.5)


def test_cell_with_steady_runs_only_is_steady(table: Any) -> None:
    cell = one_cell(table, [-1, -1], [S, S])
    assert (cell["class"], cell["oscillating"]) == ("steady", 0.0)
    assert cell["votes"] == {"steady": 2}


def test_runs_without_a_window_are_counted_apart(table: Any) -> None:
    cell = one_cell(table, [-1, -1, 0], [W, S, D])
    assert cell["votes"] == {"ordered": 1, "steady": 1, "no_window": 1}


@pytest.mark.parametrize(
    ("status", "expected"),
    [([W], "no_window"), ([W, S], "no_window"), ([W, S, S], "steady"), ([W, N], "no_window")],
)
def test_a_cell_is_steady_only_if_most_of_its_runs_are(
    table: Any, status: list[Status], expected: str
) -> None:
    assert one_cell(table, [-1] * len(status), status)["class"] == expected


def test_cell_without_result_has_no_class(table: Any) -> None:
    cell = one_cell(table, [-1, -1], [N, F])
    assert (cell["class"], cell["votes"], cell["entropy_bits"]) == (None, {}, 0.0)
    assert cell["oscillating"] is None


def test_ties_go_to_the_larger_total_membership(table: Any) -> None:
    assert one_cell(table, [0, 2, 0, 2], [D] * 4, sizes=[10, 50, 30])["class"] == "disordered"
    assert one_cell(table, [0, 2, 0, 2], [D] * 4, sizes=[40, 50, 30])["class"] == "ordered"


def test_all_steady_sweep_without_classes(table: Any) -> None:
    points = table(np.array([3, 3, 4]))
    cells = modal_classes(points, np.array([S, S, S]), cut_of([-1, -1, -1], names=()))
    assert [cell["class"] for cell in cells] == ["steady", "steady"]
    assert [cell["votes"] for cell in cells] == [{"steady": 2}, {"steady": 1}]


run = st.sampled_from([(0, D), (1, D), (2, D), (-1, S), (-1, W), (-1, N), (-1, F)])


@given(st.lists(st.tuples(st.integers(1, 4), run), min_size=1, max_size=40))
def test_modal_classes_equal_the_naive_twin(runs: list[Any]) -> None:
    points, label, status = (np.array(x) for x in zip(*((p, *r) for p, r in runs), strict=True))
    cut = cut_of(label)
    members = dict(zip(NAMES, cut.sizes.tolist(), strict=True))

    class Cells:
        def cells(self) -> Any:
            values, cell = np.unique(points, return_inverse=True)
            return cell, {"P": values}

    votes = run_names(cut.labels, status, cut.names)
    for cell in modal_classes(Cells(), status, cut):
        mine = [vote for vote, p in zip(votes, points, strict=True) if p == cell["P"]]
        assert cell["class"] == naive.modal_class(mine, members)
        assert cell["entropy_bits"] == pytest.approx(naive.entropy_bits(mine), abs=1e-12)
        assert sum(cell["votes"].values()) == sum(vote is not None for vote in mine)


def test_runs_are_named_by_class_or_outcome() -> None:
    names = run_names(np.array([0, 2, -1, -1, -1, -1]), [D, D, S, W, N, F], NAMES)
    assert names == ["ordered", "disordered", "steady", "no_window", None, None]
