"""Continues a sweep after the time limit of a batch job."""

from __future__ import annotations

import os
import sys

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.run.driver import Driver
from chimera_hpc.run.slurm import queue
from chimera_hpc.run.slurm.queue import SlurmFailed
from chimera_hpc.run.slurm.walltime import NEAR


def go_on(status: int, driver: Driver, times: int) -> int:
    """Put this job back into the queue when its time ran out; return the exit status.

    The job keeps its number, so that jobs that depend on it wait. One that was cancelled stays so.
    SLURM counts how often a job went back, for whatever reason; that count is the limit.
    """
    job = os.environ.get("SLURM_JOB_ID")
    restarts = int(os.environ.get("SLURM_RESTART_COUNT", "0"))
    if status != Exit.MORE_TO_DO or driver.ended_by != NEAR or not job or restarts >= times:
        return status
    try:
        queue.requeue(job)
        print(f"job {job} goes on later: {restarts + 1} of {times}", flush=True)
    except (SlurmFailed, BadInput) as error:
        print(f"job {job} could not be put back into the queue: {error}", file=sys.stderr)
    return status
