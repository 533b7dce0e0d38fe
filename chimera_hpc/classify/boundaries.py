"""Boundaries between classes on the graph of cells, and where further cells make them sharper.

Neighbours along an axis are consecutive cells with the same values of all other axes. Cells whose
class is not decided may lie between the two decided cells of a boundary.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.tree import Integers

Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Boundary:
    """Two cells with different decided classes and no other decided cell between them."""

    axis: str
    cells: tuple[int, ...]
    """Numbers of the cells along the axis, from the lower one to the higher one."""

    @property
    def ends(self) -> tuple[int, int]:
        return self.cells[0], self.cells[-1]


def boundaries(columns: Columns, classes: Integers, axis: str) -> Iterator[Boundary]:
    """Yield the boundaries along an axis.

    columns: (n_cells,) values of the axes that vary independently.
    classes: (n_cells,) decided class of each cell, -1 where none is.
    """
    for line in _lines(columns, axis):
        between: list[int] = []
        for cell in line:
            if between and classes[cell] not in (-1, classes[between[0]]):
                yield Boundary(axis, (*between, cell))
            if classes[cell] >= 0:
                between = [cell]
            elif between:
                between.append(cell)


def halves(boundary: Boundary, values: NDArray[Any], distance: float) -> list[int | float]:
    """Return the values halfway between the ends of a boundary and the cells next to them.

    values: (n_cells,) of the axis; between integers there are integers only.
    distance: cells that are no farther apart get none.
    """
    cells = boundary.cells
    edges = dict.fromkeys([cells[:2], cells[-2:]])
    found = []
    for low, high in ((values[a].item(), values[b].item()) for a, b in edges):
        middle = (low + high) // 2 if isinstance(low, int) else (low + high) / 2
        if high - low > distance and low < middle < high:
            found.append(middle)
    return found


def new_cells(
    columns: Columns,
    classes: Integers,
    waiting: NDArray[np.bool_],
    distances: Mapping[str, float],
    independent: Sequence[str],
) -> list[dict[str, int | float]]:
    """Return the cells that make the boundaries along the axes of `distances` sharper, each once.

    waiting: (n_cells,) cells that get further runs; a boundary with one is left for later.
    independent: names of the axes that vary independently; the new cells have values for these.
    """
    free = {name: columns[name] for name in independent}
    found: dict[tuple[int | float, ...], None] = {}
    for axis, distance in distances.items():
        for boundary in boundaries(free, classes, axis):
            if waiting[list(boundary.cells)].any():
                continue
            cell = {name: column[boundary.cells[0]].item() for name, column in free.items()}
            for value in halves(boundary, free[axis], distance):
                found[tuple({**cell, axis: value}.values())] = None
    return [dict(zip(free, row, strict=True)) for row in found]


def _lines(columns: Columns, axis: str) -> Iterator[list[int]]:
    """Yield the cells of each line along an axis, by rising value."""
    others = [column for name, column in columns.items() if name != axis]
    order = np.lexsort([columns[axis], *others])
    new_line = np.zeros(max(0, len(order) - 1), dtype=np.bool_)
    for column in others:
        new_line |= np.diff(column[order]) != 0
    ends = [0, *(np.flatnonzero(new_line) + 1).tolist(), len(order)]
    for start, stop in pairwise(ends):
        yield order[start:stop].tolist()
