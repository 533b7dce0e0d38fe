"""Which axes of a sweep vary independently, and the names of points and cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

SYMBOLS = {
    "epsilon": r"\epsilon",
    "sigma": r"\sigma",
    "phi": r"\varphi",
    "delta": r"\delta",
    "flips": "Q_r",
}
"""How parameters are written in figures, where it is not their name."""
UNDECIDED = "undecided"
"""What tables and maps of letters show of a cell whose class is not decided."""


@dataclass(frozen=True, eq=False)
class FreeAxis:
    """Parameters that vary together, such as P and Q where Q = P, and their value in each cell."""

    names: tuple[str, ...]
    values: NDArray[Any]
    """(n_cells,)"""

    @property
    def plain(self) -> str:
        """The axis in text: ``P = Q``."""
        return " = ".join(self.names)

    @property
    def symbol(self) -> str:
        """The axis in a figure: ``$P = Q$``."""
        return f"${' = '.join(map(_symbol, self.names))}$"

    @cached_property
    def digits(self) -> int:
        """Fewest significant digits, four or more, with which no two values look alike."""
        values = np.unique(self.values).tolist()
        enough = (k for k in range(4, 17) if len({number(x, k) for x in values}) == len(values))
        return next(enough, 17)

    def label(self, value: float) -> str:
        """Write one of the axis' values for people."""
        return number(value, self.digits)


def free_axes(cells: Mapping[str, NDArray[Any]], axes: Sequence[str]) -> list[FreeAxis]:
    """Return the axes that vary and don't follow from those before them.

    `cells` holds a column (n_cells,) for each parameter, `axes` are the names to look at. A column
    that equals an earlier one joins it; one that is another function of the earlier ones is left
    out.
    """
    free: list[FreeAxis] = []
    for name in axes:
        column = cells.get(name)
        if column is None or len(column) == 0 or bool((column == column[0]).all()):
            continue
        twin = next((i for i, f in enumerate(free) if np.array_equal(f.values, column)), None)
        if twin is not None:
            free[twin] = FreeAxis((*free[twin].names, name), free[twin].values)
        elif _count([*(f.values for f in free), column]) > _count([f.values for f in free]):
            free.append(FreeAxis((name,), column))
    return free


def describe(row: Mapping[str, int | float], axes: Sequence[FreeAxis], math: bool = False) -> str:
    """Return where a point lies: ``P = Q = 9``, or ``P = 9, Q = 3`` where they differ."""
    parts = []
    for axis in axes:
        equal = len({row[name] for name in axis.names}) == 1
        for names in [axis.names] if equal else [(name,) for name in axis.names]:
            value = axis.label(row[names[0]])
            words = [_symbol(name) if math else name for name in names]
            text = " = ".join([*words, value])
            parts.append(f"${text}$" if math else text)
    return ", ".join(parts)


def decided_class(cell: Mapping[str, Any]) -> str | None:
    """Return what tables show of an entry of ``decide.cells``; None where no run has a vote."""
    name: str | None = cell["class"]
    return name if name is None or cell["decided"] else UNDECIDED


def number(value: float, digits: int = 4) -> str:
    """Write a parameter for people: integers as they are, others in so many digits."""
    return str(value) if isinstance(value, int | np.integer) else f"{value:.{digits}g}"


def _count(columns: Sequence[NDArray[Any]]) -> int:
    """Return the number of different rows."""
    if not columns:
        return 1
    codes = np.stack([np.unique(column, return_inverse=True)[1] for column in columns], axis=1)
    return len(np.unique(codes, axis=0))


def _symbol(name: str) -> str:
    text = name.replace("_", r"\_")
    return SYMBOLS.get(name, rf"\mathrm{{{text}}}" if len(name) > 1 else text)
