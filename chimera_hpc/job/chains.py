"""Chains of a sweep with a table [continue]: order of the points, and checks of the job.

A chain is a block: its points differ in the axis that is followed, and in the direction, and lie
one behind the other in the order in which they are computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job.axes import Axis, Values, references
from chimera_hpc.job.continue_table import ContinueTable
from chimera_hpc.job.parameters import DIRECTION
from chimera_hpc.job.points import expand
from chimera_hpc.models.parameters import Column

if TYPE_CHECKING:
    from chimera_hpc.job.spec import Sweep

FORWARD, BACKWARD = 1, -1
_WAYS = {"forward": (FORWARD,), "backward": (BACKWARD,), "both": (FORWARD, BACKWARD)}


def ways(table: ContinueTable) -> tuple[int, ...]:
    """Return the directions of a chain, in the order in which it takes them."""
    return _WAYS[table.direction]


def followed(sweep: Sweep) -> tuple[float, ...]:
    """Return the rising values of the axis that is followed; none without [continue]."""
    if sweep.continue_ is None:
        return ()
    axis = sweep.axes[sweep.continue_.along]
    assert isinstance(axis, Values)
    return tuple(sorted(axis.values))


def chain_length(sweep: Sweep) -> int:
    """Return the number of points of a chain."""
    assert sweep.continue_ is not None
    return len(followed(sweep)) * len(ways(sweep.continue_))


def in_chains(axes: Mapping[str, Axis], table: ContinueTable) -> dict[str, Column]:
    """Return the product of the axes as columns, chain after chain, and their direction."""
    followed = axes[table.along]
    assert isinstance(followed, Values)
    others = {name: axis for name, axis in axes.items() if name != table.along}
    rising = Values(tuple(sorted(followed.values)))
    columns = expand({**others, table.along: rising})
    rows = np.arange(len(columns["seed"])).reshape(-1, len(rising.values))
    taken = {FORWARD: rows, BACKWARD: rows[:, ::-1]}
    order = np.hstack([taken[way] for way in ways(table)])
    way = np.repeat(ways(table), len(rising.values))
    ordered = {name: column[order.ravel()] for name, column in columns.items()}
    return {**ordered, DIRECTION.name: np.tile(way, len(rows)).astype(np.int64)}


def axis_names(axes: Mapping[str, Axis], table: ContinueTable) -> tuple[str, ...]:
    """Return the names of the columns that vary, `seed` last."""
    both = (DIRECTION.name,) if len(ways(table)) > 1 else ()
    return (*(name for name in axes if name != "seed"), *both, "seed")


def check_chains(table: ContinueTable, axes: Mapping[str, Axis], block: int) -> None:
    """Raise BadInput for an axis that cannot be followed, and for blocks that are no chains.

    block: run.block of the job.
    """
    along, known = table.along, [name for name in axes if name not in ("seed", "delta")]
    where = f"continue.along: {short(along)}"
    if along not in known:
        hint = "; it only moves first states" if along in ("delta", "seed", "seeds") else ""
        raise BadInput(f"{where} is not an axis of [grid]{hint or nearest(along, known)}")
    axis = axes[along]
    if not isinstance(axis, Values):
        raise BadInput(f"{where} depends on another axis; its values must be the same everywhere")
    if len(axis.values) < 2:
        raise BadInput(f"{where} has one value; a chain needs at least 2")
    for name, other in axes.items():
        if along in references(other):
            raise BadInput(f"{where}: the axis {name} depends on it, so no chain keeps its {name}")
    if DIRECTION.name in axes:
        raise BadInput(f"{where}: the model's own axis {DIRECTION.name} is in the way")
    if block:
        raise BadInput(f"run.block: {block}, but with [continue] a chain is a block: leave it out")
