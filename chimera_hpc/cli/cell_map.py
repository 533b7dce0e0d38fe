"""A map of cells for the terminal: a sign for each, and a colour where the terminal has any.

Light on purpose: neither the store's library nor the reduction is loaded.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status

if TYPE_CHECKING:
    from rich.text import Text

    from chimera_hpc.reduction.cells import FreeAxis

MOST_POINTS = 200_000
"""Beyond this many, a map takes longer to make than one waits for a status."""
_MOST_RESULTS = 20_000_000
"""Bytes of a results.json that is read for the classes."""
_MOST_MAPS = 4
PENDING, PART, WHOLE, FAILED = "pending", "part", "done", "failed"
_SIGNS = {PENDING: "·", PART: "◐", WHOLE: "●", FAILED: "✗"}
_PLAIN_SIGNS = {PENDING: ".", PART: "+", WHOLE: "#", FAILED: "!"}
_STYLES = {
    PENDING: "dim",
    PART: "cyan",
    WHOLE: "green",
    FAILED: "bold #ffffff on #a00000",
    "ordered": "#000000 on #ee8866",
    "chimera": "#ffffff on #0057b8",
    "disordered": "#ffffff on #555555",
    "steady": "#000000 on #cccccc",
    "no_window": "#000000 on #d9cf8c",
}
_OTHER_STYLE = "#000000 on #66ccbb"


@dataclass(frozen=True)
class Cells:
    """The cells of a sweep, as one map shows them."""

    axes: Sequence[FreeAxis]
    cell: NDArray[np.int64]
    """Cell of each point."""
    classes: Sequence[str | None]
    """Class of each cell by results.json, with [decide] its decided one, else its modal class.

    None where unknown, empty without results.json."""

    @classmethod
    def read(cls, store: Path, metadata: Mapping[str, Any]) -> Cells | None:
        """Read the cells of a store; None when it has too many points, or is damaged."""
        if int(metadata["attributes"]["n_points"]) > MOST_POINTS:
            return None
        from chimera_hpc.job import Sweep
        from chimera_hpc.job.together import points_of
        from chimera_hpc.reduction.cells import free_axes
        from chimera_hpc.store.origin import stored_origin

        specs = metadata["attributes"]["specs"]
        try:
            origin = stored_origin(store, metadata)
            points = points_of([Sweep.from_dict(spec, str(store), origin) for spec in specs])
        except BadInput:
            return None
        cell, columns = points.cells()
        axes = free_axes(columns, [name for name in points.axes if name != "seed"])
        n_cells = len(columns["delta"])
        return cls(axes, cell, _classes(store.parent / "results.json", n_cells))

    def states(self, status: NDArray[np.int64]) -> list[str]:
        """Return pending, part, done or failed for each cell; failed if any of its points did."""
        n = int(self.cell.max(initial=-1)) + 1
        total = np.bincount(self.cell, minlength=n)
        never = np.bincount(self.cell[status == Status.NEVER], minlength=n)
        codes = [int(code) for code in Status if code.is_failure]
        failed = np.bincount(self.cell[np.isin(status, codes)], minlength=n)
        chosen = np.select([failed > 0, never == total, never > 0], [0, 1, 2], 3)
        return [(FAILED, PENDING, PART, WHOLE)[k] for k in chosen.tolist()]


def _classes(path: Path, n_cells: int) -> list[str | None]:
    try:
        if path.stat().st_size > _MOST_RESULTS:
            return []
        results = json.loads(path.read_bytes())
        if "decide" in results:
            from chimera_hpc.reduction.cells import decided_class

            classes = [decided_class(cell) for cell in results["decide"]["cells"]]
        else:
            cells = next(iter(results["cuts"].values()))["cells"]
            classes = [cell["class"] for cell in cells]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, StopIteration):
        return []
    return classes if len(classes) == n_cells else []


def draw(
    cells: Cells, status: NDArray[np.int64], width: int, height: int, plain: bool = False
) -> Text:
    """Return the map in at most `width` columns, and about `height` lines for one map.

    Cells lie over the first two axes, or in lines along a single one; sweeps of more axes get a map
    for each value of the others, the first few. Where there are more cells than room, a sign stands
    for several of them: for the worst.
    """
    from rich.text import Text

    states = cells.states(status)
    letters = letters_of(name for name in cells.classes if name)
    names = cells.classes or [None] * len(states)
    marks = [
        Mark(state, name if state in (PART, WHOLE) else None, letters.get(name or ""))
        for state, name in zip(states, names, strict=True)
    ]
    text = Text()
    if not cells.axes:
        _append(text, marks[0], plain)
    elif len(cells.axes) == 1:
        _strip(text, cells.axes[0], marks, width, plain)
    else:
        _maps(text, cells, marks, width, height, plain)
    text.append("\n")
    _legend(text, marks, plain)
    return text


def letters_of(names: Iterable[str]) -> dict[str, str]:
    """Give each class a capital letter of its own, if possible its first."""
    taken: dict[str, str] = {}
    for name in sorted(set(names)):
        wishes = [*name.upper(), *"ABCDEFGHIJKLMNOPQRSTUVWXYZ"]
        taken[name] = next((c for c in wishes if c.isalpha() and c not in taken.values()), "?")
    return taken


class Mark(NamedTuple):
    """What is shown of a cell."""

    state: str
    name: str | None = None
    """Its class, where that is known and the state is neither failed nor pending."""
    letter: str | None = None

    @property
    def style(self) -> str:
        if self.name is None:
            return _STYLES[self.state]
        return _STYLES.get(self.name.split("-")[0], _OTHER_STYLE)

    def sign(self, plain: bool) -> str:
        """The class's letter, small while runs are still to come, or a sign for the state."""
        if self.name is None or self.letter is None:
            return (_PLAIN_SIGNS if plain else _SIGNS)[self.state]
        return self.letter if self.state == WHOLE else self.letter.lower()


def _append(text: Text, mark: Mark, plain: bool, width: int = 1) -> None:
    text.append(mark.sign(plain).center(width), style=mark.style)


def _strip(text: Text, axis: FreeAxis, marks: Sequence[Mark], width: int, plain: bool) -> None:
    """Append cells along one axis in as many lines as they need, each over its values."""
    order = np.argsort(axis.values, kind="stable").tolist()
    labels = [axis.label(axis.values[i]) for i in order]
    size = next((k for k in (3, 2, 1) if k * len(order) <= width), 1)
    length = max(1, width // size)
    if length < len(order) and length >= 20:
        length -= length % 10
    text.append(f"{axis.plain}\n", style="bold")
    for start in range(0, len(order), length):
        for i in order[start : start + length]:
            _append(text, marks[i], plain, size)
        text.append("\n" + _heads(labels[start : start + length], size, width) + "\n")


def _maps(
    text: Text, cells: Cells, marks: Sequence[Mark], width: int, height: int, plain: bool
) -> None:
    others = cells.axes[2:]
    keys = list(zip(*(axis.values.tolist() for axis in others), strict=True))
    keys = keys or [()] * len(marks)
    different = list(dict.fromkeys(keys))
    for key in different[:_MOST_MAPS]:
        chosen = [i for i, k in enumerate(keys) if k == key]
        if others:
            parts = [f"{axis.plain} = {axis.label(v)}" for axis, v in zip(others, key, strict=True)]
            text.append(", ".join(parts) + "\n", style="bold")
        _map(text, cells.axes[0], cells.axes[1], chosen, marks, width, height, plain)
    if len(different) > _MOST_MAPS:
        text.append(f"and {len(different) - _MOST_MAPS} more such maps\n")


def _map(
    text: Text,
    across: FreeAxis,
    up: FreeAxis,
    chosen: Sequence[int],
    marks: Sequence[Mark],
    width: int,
    height: int,
    plain: bool,
) -> None:
    """Append one map, the second axis upwards."""
    x, y = np.unique(across.values).tolist(), np.unique(up.values).tolist()
    margin = max(len(up.plain), *(len(up.label(value)) for value in y)) + 1
    room = max(1, width - margin)
    size = next((k for k in (3, 2, 1) if k * len(x) <= room), 1)
    fold_x, fold_y = -(-len(x) // (room // size)), -(-len(y) // max(4, height))
    grid: dict[tuple[int, int], Mark] = {}
    column, row = np.searchsorted(x, across.values), np.searchsorted(y, up.values)
    for i in chosen:
        place = (int(column[i]) // fold_x, int(row[i]) // fold_y)
        grid[place] = min(marks[i], grid.get(place, marks[i]), key=_rank)
    text.append(f"{up.plain}\n", style="bold")
    for line in reversed(range(-(-len(y) // fold_y))):
        text.append(up.label(y[line * fold_y]).rjust(margin - 1) + " ")
        for k in range(-(-len(x) // fold_x)):
            if (k, line) in grid:
                _append(text, grid[k, line], plain, size)
            else:
                text.append(" " * size)
        text.append("\n")
    text.append(" " * margin + _heads([across.label(v) for v in x[::fold_x]], size, room))
    text.append(f"  {across.plain}\n", style="bold")
    if fold_x * fold_y > 1:
        text.append(f"each sign stands for {fold_x} by {fold_y} cells, the worst of them\n")


def _heads(labels: Sequence[str], size: int, room: int) -> str:
    """Return a line with the labels of columns, as many as fit with a blank between them."""
    step = max(1, -(-(max(map(len, labels)) + 1) // size))
    line = ""
    for k in range(0, len(labels), step):
        if k * size + len(labels[k]) <= room:
            line = line.ljust(k * size) + labels[k].rjust(min(size - (size > 2), 3))
    return line


def _rank(mark: Mark) -> int:
    return (FAILED, PENDING, PART, WHOLE).index(mark.state)


def _legend(text: Text, marks: Sequence[Mark], plain: bool) -> None:
    words = {FAILED: "some failed", PENDING: "not run yet", PART: "in part", WHOLE: "done"}
    states = [Mark(state) for state in (WHOLE, PART, FAILED, PENDING)]
    classes = {mark.name: mark for mark in marks if mark.name}
    entries = [(mark._replace(state=WHOLE), name) for name, mark in sorted(classes.items())]
    entries += [(mark, words[mark.state]) for mark in states if mark.state in _nameless(marks)]
    for mark, word in entries:
        _append(text, mark, plain)
        text.append(f" {word.replace('_', ' ')}   ")
    if any(mark.name and mark.state == PART for mark in marks):
        text.append("(small letter: some of its runs are still to come)")


def _nameless(marks: Sequence[Mark]) -> set[str]:
    return {mark.state for mark in marks if mark.name is None}
