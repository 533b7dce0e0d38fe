"""The only maker of Dask clusters: on this machine, or one that is already running."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.errors import BadInput

if TYPE_CHECKING:
    from distributed import Client

LOOPBACK = "127.0.0.1"

ONE_THREAD = {
    name: "1"
    for name in (
        "OMP_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "NUMBA_NUM_THREADS",
    )
}
"""Environment of a worker process: it computes with one thread, whatever library it calls."""

SETTINGS: dict[str, Any] = {
    # The claims in the store count the deaths of workers and find the culprit; Dask must not give
    # up on a block that merely stood in the queue of a worker that died.
    "distributed.scheduler.allowed-failures": 1000,
    # A worker that hangs (stopped, or its node gone) is given up after this time.
    "distributed.scheduler.worker-ttl": "60s",
    # A block belongs to the worker that claimed it.
    "distributed.scheduler.work-stealing": False,
    "distributed.nanny.pre-spawn-environ": ONE_THREAD,
    "distributed.worker.preload": ["chimera_hpc.worker"],
    "distributed.admin.tick.limit": "1h",
    "distributed.logging": {"distributed": "error", "tornado": "critical", "bokeh": "error"},
}


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def local_cluster(
    workers: int, scratch: Path | None = None, memory_limit: str | None = "auto"
) -> Iterator[Client]:
    """Start one-thread worker processes on this machine and give a client of them.

    Scheduler, workers and dashboard listen on the loopback interface only.

    Parameters
    ----------
    workers : int
        Number of worker processes; 0 means one a core.
    scratch : Path, optional
        Folder for the workers' own files; a temporary one by default.
    memory_limit : str, optional
        Memory at which a worker is restarted; a share of the machine's by default.
    """
    import dask
    from distributed import Client, LocalCluster

    with (
        dask.config.set(SETTINGS),
        LocalCluster(
            n_workers=workers or usable_cores(),
            threads_per_worker=1,
            processes=True,
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",
            worker_dashboard_address=f"{LOOPBACK}:0",
            memory_limit=memory_limit,
            local_directory=None if scratch is None else str(scratch),
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@contextmanager
def existing_cluster(scheduler_file: Path, patience: float = 60.0) -> Iterator[Client]:
    """Connect to a scheduler that is running already, by the file it wrote.

    Raises
    ------
    BadInput
        When the file is missing or the scheduler does not answer within ``patience`` seconds.
    """
    import dask
    from distributed import Client

    if not scheduler_file.is_file():
        raise BadInput(f"{scheduler_file}: no such scheduler file (dask scheduler --scheduler-file)")
    with dask.config.set(SETTINGS):
        try:
            client = Client(
                scheduler_file=str(scheduler_file), timeout=patience
            )
        except (OSError, TimeoutError, ValueError) as error:
            raise BadInput(f"{scheduler_file}: its scheduler does not answer: {error}") from None
        with client:
            yield client
