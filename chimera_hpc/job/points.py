"""Points of a sweep as columns: one array per quantity."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.axes import Axis, Between, Same, Values, references
from chimera_hpc.models.parameters import Column

MAX_POINTS = 10**8
"""Most points of one sweep."""

DTYPES: dict[type, type[np.int64] | type[np.float64]] = {int: np.int64, float: np.float64}
_MAX_CODE = 2**62
ULPS = 4
"""Largest distance, in units in the last place, at which two floats count as the same fraction. Two
ways to compute a fraction may differ by this much."""


@dataclass(frozen=True, eq=False)
class Points:
    """A list of points, in the order of the store.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (n_points,)
        Every parameter of the model, `delta` and `seed`, whether an axis or fixed; int64 or
        float64, read-only.
    axes : tuple of str
        Names of the columns that vary. The first varies slowest; `seed` is the last.
    """

    columns: dict[str, Column]
    axes: tuple[str, ...]

    def __post_init__(self) -> None:
        if len({len(column) for column in self.columns.values()}) != 1:
            raise ValueError("the columns of points must be equally long, and at least one")
        for column in self.columns.values():
            column.setflags(write=False)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, which: slice | NDArray[Any]) -> Points:
        """Return the points of a slice, an array of indices or a mask, in its order."""
        return Points({name: column[which] for name, column in self.columns.items()}, self.axes)

    def row(self, i: int) -> dict[str, int | float]:
        """Return point i as plain numbers by name."""
        return {name: column[i].item() for name, column in self.columns.items()}

    def find(self, **values: float) -> NDArray[np.int64]:
        """Return the indices of the points with these values, in increasing order.

        Integers are compared exactly, with all 64 bits. A float selects the points that hold
        exactly this value. If there are none, it selects those of the only value within `ULPS`
        units in the last place.

        Raises BadInput for an unknown name, and for a float that is near to several values but
        equal to none.
        """
        if unknown := next((name for name in values if name not in self.columns), None):
            raise BadInput(f"{unknown}: no such parameter; known: {', '.join(self.columns)}")
        found = np.arange(len(self))
        for name in sorted(values, key=lambda name: self.columns[name].dtype.kind == "f"):
            found = found[_holds(name, self.columns[name][found], values[name])]
        return found

    def cells(self) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the cells: the different combinations of all columns except the seed.

        Returns
        -------
        cell_id : ndarray of int64, shape (n_points,)
            Number of each point's cell; cells are numbered in the order of their first point.
        columns : dict of str to ndarray, shape (n_cells,)
            The columns except the seed, one entry per cell.
        """
        code = np.zeros(len(self), dtype=np.int64)
        n_codes = min(1, len(self))
        for name, column in self.columns.items():
            if name == "seed" or n_codes == 0 or bool((column == column[0]).all()):
                continue
            values, number = np.unique(column, return_inverse=True)
            if n_codes * len(values) > _MAX_CODE:
                _, code = np.unique(code, return_inverse=True)
                n_codes = len(self)
            code = code * len(values) + number
            n_codes *= len(values)
        _, first, number = np.unique(code, return_index=True, return_inverse=True)
        rank = np.empty(len(first), dtype=np.int64)
        rank[np.argsort(first)] = np.arange(len(first))
        first.sort()
        cells = {name: column[first] for name, column in self.columns.items() if name != "seed"}
        return rank[number], cells


def _holds(name: str, column: Column, value: float) -> NDArray[np.bool_]:
    """Return where a column holds a value, by the rules of `Points.find`."""
    if column.dtype.kind != "f":
        # NumPy compares an integer with a Python integer exactly, but with a float as floats.
        whole = math.isfinite(value) and int(value) == value
        return np.asarray(column == int(value)) if whole else np.zeros(len(column), dtype=np.bool_)
    exact: NDArray[np.bool_] = column == value
    if exact.any():
        return exact
    margin = ULPS * math.ulp(value)
    near: NDArray[np.bool_] = (value - margin <= column) & (column <= value + margin)
    values = np.unique(column[near]).tolist()
    if len(values) > 1:
        text = " and ".join(map(repr, values[:2]))
        raise BadInput(f"{name}={value!r}: is near to {text}; write all digits of one of them")
    return near


def appended(points: Points, more: Points) -> Points:
    """Return the points, then those of `more` that are not among them; the axes of `more`."""
    new = ~np.isin(point_keys(more, points), point_keys(points))
    columns = {
        name: np.concatenate([column, more.columns[name][new]])
        for name, column in points.columns.items()
    }
    return Points(columns, more.axes)


def point_keys(points: Points, like: Points | None = None) -> NDArray[np.void]:
    """Return each point as its bytes, in the order of the columns of `like`."""
    # Adding 0 turns -0.0 into 0.0, which is the same parameter.
    rows = [(points.columns[name] + 0).view(np.int64) for name in (like or points).columns]
    table = np.ascontiguousarray(np.stack(rows, axis=1))
    keys: NDArray[np.void] = table.view(np.dtype((np.void, 8 * len(rows))))[:, 0]
    return keys


def dependency_order(axes: Mapping[str, Axis]) -> list[str]:
    """Return the names sorted so that each comes after those it depends on.

    Otherwise, the order of declaration is kept. Every name must be an axis. Raises BadInput for a
    circular dependency.
    """
    order: list[str] = []
    waiting = list(axes)
    while waiting:
        ready = next((n for n in waiting if set(references(axes[n])) <= set(order)), None)
        if ready is None:
            circle = ", ".join(waiting)
            raise BadInput(f"grid.{waiting[0]}: the axes {circle} depend on each other in a circle")
        order.append(ready)
        waiting.remove(ready)
    return order


class Product:
    """The rows of a product of axes, any stretch of them without the others.

    axes: in order of declaration; the first varies slowest, and none is empty.

    Only the axes up to the last one that depends on another are expanded and held.
    """

    def __init__(self, axes: Mapping[str, Axis]) -> None:
        names = list(axes)
        linked = {other for name in names for other in references(axes[name])}
        linked |= {name for name in names if references(axes[name])}
        cut = max(map(names.index, linked), default=-1) + 1
        self._names = names
        self._head = expand({name: axes[name] for name in names[:cut]})
        self._tail = {name: axis for name in names[cut:] if isinstance(axis := axes[name], Values)}
        lengths = [len(axis.values) for axis in self._tail.values()]
        self._n_head = len(self._head[names[0]]) if cut else 1
        self.n_rows = self._n_head * math.prod(lengths)

    def columns(self, first: int, stop: int) -> dict[str, Column]:
        """Return rows `first` up to `stop` as columns."""
        # In place: of ten million rows, each array takes 80 MB.
        rows, tail = np.arange(first, stop), {}
        for name, axis in reversed(self._tail.items()):
            place = np.empty_like(rows)
            np.divmod(rows, len(axis.values), out=(rows, place))
            tail[name] = _entries(axis, place)
        return {n: tail[n] if n in tail else self._head[n][rows] for n in self._names}


def expand(
    axes: Mapping[str, Axis],
    check: Callable[[str, dict[str, Column]], None] = lambda name, columns: None,
) -> dict[str, Column]:
    """Return the product of the axes as columns, the first axis slowest.

    axes: in order of declaration. The values of a dependent axis are computed for each value of the
        axes it names.
    check: called with the name of each new column and the columns so far, in order of dependence.
        It can raise before a later axis makes the product large.

    Raises BadInput: more than `MAX_POINTS` rows, a circular dependency, or an empty dependent
    range.
    """
    order = dependency_order(axes)
    columns: dict[str, Column] = {}
    n_rows = 1
    for name in order:
        rows, column = _extend(name, axes[name], columns, n_rows)
        columns = {known: values[rows] for known, values in columns.items()}
        columns[name] = column
        n_rows = len(column)
        check(name, columns)
    if order != list(axes):
        keys = [_rank(axes[name], columns[name]) for name in axes]
        by_declaration = np.lexsort(keys[::-1])
        columns = {name: columns[name][by_declaration] for name in axes}
    return columns


def _extend(
    name: str, axis: Axis, columns: Mapping[str, Column], n_rows: int
) -> tuple[NDArray[np.int64], Column]:
    """Return the index of the old row that each new row extends, and the new column."""
    if isinstance(axis, Same):
        return np.arange(n_rows), columns[axis.name]
    if isinstance(axis, Values):
        refuse_huge(n_rows * len(axis.values))
        rows = np.repeat(np.arange(n_rows), len(axis.values))
        return rows, np.tile(as_array(axis), n_rows)
    low, high = (
        np.full(n_rows, end) if isinstance(end, int) else columns[end].astype(np.int64)
        for end in (axis.low, axis.high)
    )
    counts = (high - low) // axis.step + 1
    if (counts < 1).any():
        _refuse_empty(name, axis, columns, int(np.argmax(counts < 1)))
    refuse_huge(counts.sum(dtype=np.float64))
    rows = np.repeat(np.arange(n_rows), counts)
    place = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    return rows, low[rows] + axis.step * place


def as_array(axis: Values) -> Column:
    """Return the values of an independent axis, int64 or float64."""
    values = axis.values
    if isinstance(values, range):
        return np.arange(values.start, values.stop, values.step, dtype=np.int64)
    return np.array(values, dtype=np.int64 if isinstance(values[0], int) else np.float64)


def _entries(axis: Values, place: NDArray[np.int64]) -> Column:
    """Return the values of an independent axis at some places, which may be overwritten."""
    if isinstance(axis.values, range):
        place *= axis.values.step
        place += axis.values.start
        return place
    return as_array(axis)[place]


def _rank(axis: Axis, column: Column) -> NDArray[Any]:
    """Return a number that increases with the position of each value on its axis."""
    if not isinstance(axis, Values):
        return column
    values = as_array(axis)
    by_value = np.argsort(values)
    return by_value[np.searchsorted(values[by_value], column)]


def refuse_huge(n_points: float) -> None:
    """Raise BadInput for more than `MAX_POINTS`."""
    if n_points > MAX_POINTS:
        raise BadInput(f"grid: {n_points:.3g} points or more, at most {MAX_POINTS:.0e} are allowed")


def _refuse_empty(name: str, axis: Between, columns: Mapping[str, Column], row: int) -> None:
    where = ", ".join(f"{n} = {columns[n][row]}" for n in references(axis))
    raise BadInput(f"grid.{name}: the range {axis} is empty at {where}")
