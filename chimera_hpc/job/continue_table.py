"""The table [continue] of a job: points that start from the state of the point before them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from chimera_hpc.job.table import Line, Table


class ContinueTable(Table):
    """Chains of points along one axis; each point starts from the last state of the one before."""

    along: Line = Field(description="Axis of [grid] that is followed.")
    direction: Literal["forward", "backward", "both"] = Field(
        "forward",
        description="forward: rising values; backward: falling ones; both: forward, then backward "
        "in one chain; the backward half starts from the last state of the forward half.",
    )
    settle: float = Field(
        0.0,
        ge=0,
        description="Time that each point runs before its t = 0; it is not sampled.",
    )
