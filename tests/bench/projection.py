"""From here to 10,000 cores: a simulation of the run, fed with measured costs.

One driver hands out blocks through one scheduler, which is busy for a fixed time with each block;
every core takes a block, computes for a time drawn around the measured mean, writes, and asks for
the next. Job arrays need no scheduler: a core reads the ledger once and goes on alone.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Costs:
    """Measured, seconds."""

    point: float
    """Integration and features of a point, on one core."""
    block_on_worker: float
    """Claim, write and flush of a block."""
    block_on_scheduler: float
    """Processor time of the scheduler for a block."""
    point_of_ledger: float
    """Reading a point's row of the ledger, once a core, in a job array."""


@dataclass(frozen=True)
class Forecast:
    """What a run comes to."""

    cores: int
    points: int
    block: int
    hours: float
    efficiency: float
    """Computing time over cores times wall time."""
    scheduler_load: float
    """Share of the time that the scheduler is busy; 0 without one."""


def forecast(
    costs: Costs, cores: int, points: int, block: int, scheduler: bool, spread: float = 0.15
) -> Forecast:
    """Simulate a run of `points` points in blocks of `block` on `cores` cores."""
    rng = np.random.default_rng(0)
    n_blocks = -(-points // block)
    sizes = np.full(n_blocks, block)
    sizes[-1] = points - block * (n_blocks - 1)
    work = costs.point * sizes * rng.lognormal(-0.5 * spread**2, spread, n_blocks)
    ready = 0.0 if scheduler else costs.point_of_ledger * points
    free = [ready] * cores
    served = busy = 0.0
    for seconds in work:
        asked = heapq.heappop(free)
        if scheduler:
            served = max(served, asked) + costs.block_on_scheduler
            busy += costs.block_on_scheduler
            asked = served
        heapq.heappush(free, asked + seconds + costs.block_on_worker)
    wall = max(free)
    efficiency = float(work.sum()) / (cores * wall)
    return Forecast(cores, points, block, wall / 3600, efficiency, busy / wall)
