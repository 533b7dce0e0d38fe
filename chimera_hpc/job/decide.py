"""The table [decide]: runs are added until classes are decided and their boundaries are found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job.axes import Axis, Between, Same, Values
from chimera_hpc.job.points import as_array
from chimera_hpc.job.table import Table

Runs = Annotated[int, Field(ge=1, le=10**6)]


_FINEST = 1e-9
"""Of an axis, the smallest distance that it can be refined to."""


class Decide(Table):
    """The number of runs per cell, and the cells to add. `grid.seeds` equals `first`."""

    confidence: float = Field(
        0.95,
        gt=0.5,
        lt=1,
        description="The modal class of a cell is decided when the posterior probability that it "
        "leads all others exceeds this.",
    )
    first: Runs = Field(5, description="Seeds that every cell gets.")
    batch: Runs = Field(5, description="Seeds that a round adds to a cell that is not decided.")
    most: Runs = Field(100, description="Most seeds of a cell that is not decided.")
    judge: Literal["frozen", "atlas"] = Field(
        "frozen",
        description="frozen: classes come from the tree over the runs of the first round; atlas: "
        "from the first sweep in reduction.atlas.",
    )
    refine: dict[str, int | float] = Field(
        default_factory=dict,
        description="Smallest distance per axis: cells are added halfway between neighbouring "
        "cells whose decided classes differ, down to this distance.",
    )

    @field_validator("refine", mode="before")
    @classmethod
    def _numbers(cls, refine: Any) -> Any:
        for name, distance in refine.items() if isinstance(refine, dict) else ():
            number = isinstance(distance, int | float) and not isinstance(distance, bool)
            if not number or not math.isfinite(distance):
                raise BadInput(f"decide.refine.{name}: {short(distance)} is not a finite number")
        return refine

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.most < self.first:
            raise BadInput(f"decide.most: {self.most} is below decide.first = {self.first}")
        for name, distance in self.refine.items():
            if not distance > 0:
                raise BadInput(f"decide.refine.{name}: {short(distance)} is not above 0")
        return self

    def check_axes(self, axes: Mapping[str, Axis]) -> None:
        """Raise BadInput for an axis to refine that is none, follows another, or is too fine."""
        for name, distance in self.refine.items():
            axis = axes.get(name) if name != "seed" else None
            known = [other for other in axes if other != "seed"]
            if axis is None:
                raise BadInput(f"decide.refine.{name}: not an axis in [grid]{nearest(name, known)}")
            if isinstance(axis, Same):
                text = f"follows {axis.name}; refine {axis.name}"
                raise BadInput(f"decide.refine.{name}: {text}")
            whole = isinstance(axis, Between) or as_array(axis).dtype.kind == "i"
            if whole and not isinstance(distance, int):
                text = f"{short(distance)} is not an integer, as the values of {name} are"
                raise BadInput(f"decide.refine.{name}: {text}")
            length = 0.0 if isinstance(axis, Between) else _length(axis)
            if distance < _FINEST * length:
                text = f"{short(distance)} is below {_FINEST:g} of the axis, {length:g} long"
                raise BadInput(f"decide.refine.{name}: {text}")

    def check_judge(self, atlas: Sequence[str]) -> None:
        """Raise BadInput when an atlas judges and reduction.atlas names none."""
        if self.judge == "atlas" and not atlas:
            raise BadInput(
                'decide.judge: "atlas", but reduction.atlas names no sweep whose classes judge'
            )

    def full_grid(self, axes: Mapping[str, Axis], n_cells: int) -> int:
        """Return the runs of a full grid: `n_cells`, each refined axis filled, `most` seeds each.

        A range whose ends depend on others is filled by its step.
        """
        more = math.prod(_filling(axes[name], distance) for name, distance in self.refine.items())
        return round(n_cells * more) * self.most


def is_single(axis: Axis) -> bool:
    """Return whether an axis has one value, for all values of the others."""
    return isinstance(axis, Values) and len(as_array(axis)) == 1


def _filling(axis: Axis, distance: float) -> float:
    """Return how many times as many values an axis has when it is filled down to a distance."""
    if isinstance(axis, Between):
        return max(1.0, axis.step / distance)
    assert isinstance(axis, Values)
    return max(1.0, (math.floor(_length(axis) / distance + 1e-9) + 1) / len(as_array(axis)))


def _length(axis: Axis) -> float:
    assert isinstance(axis, Values)
    values = as_array(axis)
    return float(values.max() - values.min())


def check_first(grid: Mapping[str, Any], decide: Decide | None) -> None:
    """Raise BadInput for a number of seeds in [grid] that [decide] contradicts."""
    if decide is not None and grid["seeds"] != decide.first:
        raise BadInput(
            f"grid.seeds: {short(grid['seeds'])}, but with [decide] every cell has decide.first = "
            f"{decide.first} seeds in the first round; leave seeds out, or set both to the same"
        )
