"""The table [added]: cells beyond those of the grid, or with more seeds, one entry per cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.job.points import refuse_huge
from chimera_hpc.models.parameters import Column

SEEDS = "seeds"
"""The column with the number of seeds of each cell: 0 to n - 1."""
Added = Mapping[str, Sequence[int | float]]


def check_columns(added: Mapping[str, Any], axes: Sequence[str]) -> None:
    """Raise BadInput unless there is a list for each axis and for `seeds`, equally long."""
    wanted = {*axes, SEEDS}
    for name in sorted(wanted ^ set(added)):
        text = "missing" if name in wanted else f"not an axis; needed: {', '.join((*axes, SEEDS))}"
        raise BadInput(f"added.{name}: {text}")
    lengths = {name: len(values) for name, values in added.items()}
    if len(set(lengths.values())) > 1 or not all(lengths.values()):
        text = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise BadInput(f"added: the lists must be equally long, at least one entry: {text}")
    rows = {tuple(added[name][i] for name in axes) for i in range(len(added[SEEDS]))}
    if len(rows) < len(added[SEEDS]):
        raise BadInput("added: a cell is there twice")
    for count in added[SEEDS]:
        if type(count) is not int or count < 1:
            raise BadInput(f"added.seeds: {short(count)} is not a number of seeds from 1")


def cells_of(added: Added, axes: Sequence[str]) -> dict[str, Column]:
    """Return the columns of the axes, one entry per cell."""
    return {name: np.array(added[name]) for name in axes}


def expand_added(added: Added, axes: Sequence[str]) -> dict[str, Column]:
    """Return the points of the cells as columns of the axes and `seed`, seeds fastest."""
    counts = np.array(added[SEEDS], dtype=np.int64)
    refuse_huge(counts.sum(dtype=np.float64))
    rows = np.repeat(np.arange(len(counts)), counts)
    columns = {name: column[rows] for name, column in cells_of(added, axes).items()}
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    return {**columns, "seed": np.arange(len(rows)) - starts}
