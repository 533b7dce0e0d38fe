"""The modal classes as text: one line per cell, a map of letters, or a count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from chimera_hpc.classify.modes import NO_WINDOW, STEADY
from chimera_hpc.classify.naming import CLASSES
from chimera_hpc.reduction.cells import FreeAxis
from chimera_hpc.reduction.quality import POOR

Cells = Sequence[Mapping[str, Any]]

MOST_LINES = 60
WIDTH = 100
"""Limits of a table for the terminal; a larger table is shortened."""
DECIDED = "decided"
"""Stands for a cut: the classes by which the cells of a sweep with [decide] are decided."""
_NOTHING = "."


def class_table(
    cuts: Mapping[str, Cells],
    axes: Sequence[FreeAxis],
    poor: Mapping[str, Collection[str]] | None = None,
) -> str:
    """Return the modal classes as text, with the share of the runs that oscillate.

    cuts: for each cut its cells with ``class`` and ``votes``, in one order (as in results.json).
        The first cut is the one that maps and counts show.
    axes: what varies between cells.
    poor: for each cut its classes whose runs are poorly fitted; they are marked.
    """
    if not cuts:
        return ""
    bad = poor or {}
    cuts = {c: [_marked(cell, bad.get(c, ())) for cell in cells] for c, cells in cuts.items()}
    cut, cells = next(iter(cuts.items()))
    if len(axes) < 2 and len(cells) <= MOST_LINES:
        return _lines(cuts, axes)
    if len(axes) == 1:
        text = _ranges(cells, axes[0])
    elif len(axes) == 2 and (drawn := _map(cells, axes[0], axes[1])):
        which = "decided classes" if cut == DECIDED else f"modal classes of {_head(cut)}"
        text = f"{which}\n{drawn}"
    else:
        text = _counts(cells)
    return f"{text}\n{_whose(cells)}"


def _marked(cell: Mapping[str, Any], poor: Collection[str]) -> Mapping[str, Any]:
    """Return a cell with the mark behind classes that are poorly fitted, in its votes too."""

    def called(name: str) -> str:
        return name + POOR if name in poor else name

    votes = {called(name): count for name, count in cell["votes"].items()}
    return {**cell, "class": cell["class"] and called(cell["class"]), "votes": votes}


def _whose(cells: Cells) -> str:
    """Say in how many cells runs oscillate, where not every cell has a line with its share."""
    shares = [cell["oscillating"] for cell in cells if cell["oscillating"] is not None]
    mixed = [share for share in shares if 0.0 < share < 1.0]
    none = sum(share == 0.0 for share in shares)
    text = f"runs that oscillate: all in {len(shares) - len(mixed) - none} cells"
    if mixed:
        text += f", {min(mixed):.0%} to {max(mixed):.0%} of them in {len(mixed)}"
    return text + (f", none in {none}" if none else "")


def _lines(cuts: Mapping[str, Cells], axes: Sequence[FreeAxis]) -> str:
    columns = [[axis.plain, *map(axis.label, axis.values)] for axis in axes]
    for i, (cut, cells) in enumerate(cuts.items()):
        columns.append([_head(cut), *(cell["class"] or _NOTHING for cell in cells)])
        if i == 0:
            columns.append(["oscillating", *(_oscillating(cell) for cell in cells)])
            columns.append(["votes", *(_votes(cell) for cell in cells)])
    widths = [max(map(len, column)) for column in columns]
    rows = [
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()
        for row in zip(*columns, strict=True)
    ]
    return "\n".join(rows)


def _head(cut: str) -> str:
    return cut if cut == DECIDED else f"{cut} clusters"


def _oscillating(cell: Mapping[str, Any]) -> str:
    share = cell["oscillating"]
    return _NOTHING if share is None else f"{share:.0%}"


def _votes(cell: Mapping[str, Any]) -> str:
    votes = sorted(cell["votes"].items(), key=lambda vote: -vote[1])
    return ", ".join(f"{name} {count}" for name, count in votes) or "none yet"


def _ranges(cells: Cells, axis: FreeAxis) -> str:
    """List for each class the stretches of the axis that it covers."""
    order = np.argsort(axis.values, kind="stable")
    stretches: dict[str, list[list[str]]] = {}
    last = None
    for i in order:
        name = cells[i]["class"] or _NOTHING
        if name != last:
            stretches.setdefault(name, []).append([])
        stretches[name][-1].append(axis.label(axis.values[i]))
        last = name
    width = max(map(len, stretches))
    return "\n".join(
        f"{name.ljust(width)}  {axis.plain}: "
        + ", ".join(part[0] if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in parts)
        for name, parts in stretches.items()
    )


def _map(cells: Cells, across: FreeAxis, up: FreeAxis) -> str:
    """Return a letter for each cell, the second axis upwards; empty when that is too large."""
    x, column = np.unique(across.values, return_inverse=True)
    y, row = np.unique(up.values, return_inverse=True)
    letters = _letters(_in_order({cell["class"] for cell in cells if cell["class"]}))
    heads, sides = [across.label(value) for value in x], [up.label(value) for value in y]
    width = 1 + max(map(len, heads))
    margin = max(map(len, [*sides, up.plain]))
    if len(y) > MOST_LINES or margin + width * len(x) > WIDTH:
        return ""
    grid = [[" "] * len(x) for _ in y]
    for cell, i, j in zip(cells, row, column, strict=True):
        grid[i][j] = letters.get(cell["class"], _NOTHING)
    lines = [up.plain]
    for side, marks in zip(sides[::-1], grid[::-1], strict=True):
        lines.append(side.rjust(margin) + "".join(mark.rjust(width) for mark in marks).rstrip())
    lines.append(" " * margin + "".join(head.rjust(width) for head in heads) + f"  {across.plain}")
    lines.append(", ".join(f"{letter} {name}" for name, letter in letters.items()))
    return "\n".join(lines)


def _in_order(names: set[str]) -> list[str]:
    """Sort as in figures: ordered, chimera, disordered, others, then what does not oscillate."""
    rank = {name: i for i, name in enumerate(CLASSES)} | {STEADY: 4, NO_WINDOW: 5}
    return sorted(names, key=lambda name: (rank.get(name.rstrip(POOR), 3), name))


def _letters(names: Sequence[str]) -> dict[str, str]:
    """Give each name a letter of its own, if possible its first."""
    taken: dict[str, str] = {}
    for name in names:
        wishes = [*name, *"ABCDEFGHIJKLMNOPQRSTUVWXYZ"]
        taken[name] = next((c for c in wishes if c.isalnum() and c not in taken.values()), "?")
    return taken


def _counts(cells: Cells) -> str:
    counts = Counter(cell["class"] or "no result yet" for cell in cells)
    return "\n".join(f"{count:8d} cells {name}" for name, count in counts.most_common())
