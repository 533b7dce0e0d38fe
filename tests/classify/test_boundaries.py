"""Boundaries on the graph of cells, and the cells that make them sharper."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.classify.boundaries import boundaries, halves, new_cells

NEVER = np.zeros(64, dtype=bool)


def cells_of(boundary_list):
    return [boundary.cells for boundary in boundary_list]


def test_undecided_cells_lie_within_a_boundary_and_equal_ends_are_none():
    x = np.array([0.0, 3.0, 1.0, 2.0, 4.0, 5.0])
    classes = np.array([0, -1, 0, -1, 1, 1])
    assert cells_of(boundaries({"x": x}, classes, "x")) == [(2, 3, 1, 4)]
    assert cells_of(boundaries({"x": x}, np.where(classes == 1, 0, classes), "x")) == []


def test_lines_hold_all_other_axes():
    x, y = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])
    classes = np.array([0, 1, 0, 0])
    assert cells_of(boundaries({"x": x, "y": y}, classes, "x")) == [(0, 1)]
    assert cells_of(boundaries({"x": x, "y": y}, classes, "y")) == [(1, 3)]


@pytest.mark.parametrize(
    ("values", "distance", "expected"),
    [
        ([0.0, 1.0], 0.5, [0.5]),
        ([0.0, 1.0], 1.0, []),
        ([2, 5], 1, [3]),
        ([2, 3], 1, []),
        ([0.0, 0.25, 0.5, 1.0], 0.2, [0.125, 0.75]),  # beside undecided cells, not between them
    ],
)
def test_halves(values, distance, expected):
    column = np.array(values)
    classes = np.array([0, *[-1] * (len(values) - 2), 1])
    (found,) = boundaries({"x": column}, classes, "x")
    assert halves(found, column, distance) == expected


def test_a_boundary_that_gets_more_runs_is_left_for_later():
    columns = {"x": np.array([0.0, 1.0, 2.0])}
    waiting = np.array([False, True, False])
    arguments = (np.array([0, -1, 1]), waiting, {"x": 0.1}, ["x"])
    assert new_cells(columns, *arguments) == []


def test_bisection_finds_a_curve_down_to_the_distances():
    columns = {"x": np.array([0.0, 1.0] * 2), "k": np.array([0, 0, 32, 32])}

    def classes():
        return (columns["x"] + columns["k"] / 40.0 > 0.7).astype(np.int64)

    for _ in range(20):
        never = np.zeros(len(columns["x"]), dtype=bool)
        made = new_cells(columns, classes(), never, {"x": 0.05, "k": 1}, ["x", "k"])
        if not made:
            break
        columns = {
            name: np.append(column, [cell[name] for cell in made])
            for name, column in columns.items()
        }
    pairs = list(zip(columns["x"].tolist(), columns["k"].tolist(), strict=True))
    assert made == []
    assert len(set(pairs)) == len(pairs) < 33 * 21 / 3
    for axis, distance in (("x", 0.05), ("k", 1)):
        for found in boundaries(columns, classes(), axis):
            low, high = (columns[axis][i] for i in found.ends)
            assert high - low <= distance
