"""The time that a batch job has left, and which blocks still fit into it.

A block is begun only when its predicted time fits before the job's limit. The prediction comes from
what points nearby in the grid took, as the ledger tells; before any is measured, from a rough rule.
The first block of a process is begun in any case: a prediction may be wrong, and finished points of
a block that is broken off are kept, so that every job makes progress.
"""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.blocks import point_seconds
from chimera_hpc.run.slurm.queue import time_left

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

DRAIN = "CHIMERA_HPC_DRAIN"
"""Environment variable: seconds before a job's limit at which it is to be over."""
WORKER = "CHIMERA_HPC_WORKER_JOB"
"""Environment variable, set in jobs that hold one Dask worker each: they end by themselves."""
NEAR = "the time limit of this SLURM job is near"
_LONGEST_DRAIN, _DRAIN_SHARE = 60.0, 0.1
_SAFETY = 1.5
_NEIGHBOURS = 3
_MOST_MEASURED = 2000
_LOOK_SECONDS = 60.0

Rows = NDArray[np.int64]

leaving = threading.Event()
"""Set when this process is to take no more work and to stop its current work cleanly."""


@dataclass
class Hours:
    """The time limit of a process inside a batch job."""

    leave_by: float
    """When it is to be over, in seconds since 1970."""
    begun: bool = False
    _models: dict[object, tuple[float, CostModel]] = field(default_factory=dict)

    def over(self) -> bool:
        return time.time() >= self.leave_by

    def fits(self, store: Store, rows: Rows) -> bool:
        """Return whether these points may be begun; the first ones always may."""
        if self.over():
            return False
        if not self.begun:
            self.begun = True
            return True
        return time.time() + _SAFETY * self._model(store).seconds(rows) < self.leave_by

    def _model(self, store: Store) -> CostModel:
        """Return what is known of the costs, looked up once a minute, and when the store grows."""
        looked, model = self._models.get(store.path, (-_LOOK_SECONDS, None))
        grown = model is not None and model.n_points < len(store.points)
        if model is None or grown or time.monotonic() - looked > _LOOK_SECONDS:
            ledger = store.ledger()
            model = CostModel(store.sweep, store.points, ledger["status"], ledger["elapsed_us"])
            self._models[store.path] = (time.monotonic(), model)
        return model


class CostModel:
    """Predicts the work of points from that of the points nearby that have been done.

    status, elapsed_us (n_points,): as in the ledger.
    """

    def __init__(self, sweep: Sweep, points: Points, status: Rows, elapsed_us: Rows) -> None:
        self.n_points = len(points)
        columns = [c for name, c in points.columns.items() if name != "seed" and np.ptp(c) > 0]
        self._places = np.zeros((len(points), 1 + len(columns)))
        for k, column in enumerate(columns):
            self._places[:, k] = (column - column.min()) / np.ptp(column)
        measured = np.flatnonzero((status != Status.NEVER) & (elapsed_us > 0))
        chosen = measured[:: max(1, len(measured) // _MOST_MEASURED)]
        self._known, member = np.unique(self._places[chosen], axis=0, return_inverse=True)
        counts = np.bincount(member.ravel())
        self._seconds = np.bincount(member.ravel(), elapsed_us[chosen] / 1e6) / counts
        self._guess = point_seconds(sweep)

    def seconds(self, rows: Rows) -> float:
        """Return the predicted work of these points on one core, in seconds.

        The mean over a cell's three nearest measured cells, weighted by inverse square distance.
        """
        if not len(self._known):
            return self._guess * len(rows)
        cells, counts = np.unique(self._places[rows], axis=0, return_counts=True)
        total = 0.0
        for cell, count in zip(cells, counts, strict=True):
            square = ((self._known - cell) ** 2).sum(axis=1)
            near = np.argsort(square, kind="stable")[:_NEIGHBOURS]
            weight = 1 / (square[near] + 1e-12)
            total += float(count * (weight @ self._seconds[near]) / weight.sum())
        return total


@cache
def this_job() -> Hours | None:
    """Return the hours of the batch job that this process is in; None outside, or without limit."""
    job = os.environ.get("SLURM_JOB_ID")
    if job is None:
        return None
    left = _seconds_left(job)
    if left is None:
        return None
    return Hours(time.time() + left - _drain(left))


def time_to_leave() -> bool:
    """Return whether this process is to stop, by order or because its job ends; cheap."""
    if leaving.is_set():
        return True
    hours = this_job()
    return hours is not None and hours.over()


def leave_if_worker() -> None:
    """End this process cleanly if it is the only one of its batch job; another takes over."""
    if WORKER in os.environ:
        leaving.set()


def _seconds_left(job: str) -> float | None:
    # Newer versions of SLURM tell it in the environment.
    end = os.environ.get("SLURM_JOB_END_TIME", "")
    return float(end) - time.time() if end.isdecimal() else time_left(job)


def _drain(left: float) -> float:
    try:
        return float(os.environ[DRAIN])
    except (KeyError, ValueError):
        return min(_LONGEST_DRAIN, _DRAIN_SHARE * left)
