"""Dask clusters on this machine, or one that already runs; `run.slurm` makes the others."""

from __future__ import annotations

import json
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.memory import share_of_memory
from chimera_hpc.base.processes import usable_cores
from chimera_hpc.run.fork_server import ONE_THREAD, signals_blocked, start_fork_server, start_method

if TYPE_CHECKING:
    from distributed import Client, Scheduler, SpecCluster

LOOPBACK = "127.0.0.1"
NO_DASHBOARD = ("--no-dashboard", "--dashboard-address", f"{LOOPBACK}:0")
"""Of a worker process: loading Bokeh would take it a second. Its server listens all the same, so it
is told where."""
_CLOSE_SECONDS = 30.0
_HEARTBEAT_SECONDS = 5.0
_INTERVAL = "heartbeat-interval"
"""What the scheduler's answer to a worker's heartbeat calls the time until the next one."""


def settings(patience: float = 60.0) -> dict[str, Any]:
    """Return how Dask is set up: `patience` is the time after which a silent worker is given up."""
    return {
        # The claims in the store count the deaths of workers and find the culprit; Dask must not
        # give up on a block that merely stood in the queue of a worker that died.
        "distributed.scheduler.allowed-failures": 1_000_000,
        # A worker that hangs (stopped, or its node gone) is given up after this time.
        "distributed.scheduler.worker-ttl": f"{patience}s",
        # A worker that died is replaced by its nanny, however long that takes on a busy machine;
        # Dask would give up the nanny, and with it a worker that has just come up.
        "distributed.deploy.lost-worker-timeout": "30d",
        # A block belongs to the worker that claimed it.
        "distributed.scheduler.work-stealing": False,
        "distributed.nanny.pre-spawn-environ": ONE_THREAD,
        # A worker near its limit must neither stand still with its blocks nor move its few bytes to
        # a disk: it works on, or is ended and leaves word (see `worker`).
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.worker.memory.pause": False,
        "distributed.worker.memory.terminate": 0.95,
        # Looking many times a second how processes are doing takes time of the cores that
        # integrate, in the driver's process most of all: it has no core of its own.
        "distributed.worker.profile.enabled": False,
        "distributed.worker.memory.monitor-interval": "500ms",
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.admin.tick.interval": "10s",
        "distributed.admin.tick.limit": "1h",
    }


def dask_size(size: str) -> str:
    """Return a size that is written as for SLURM, where 800 means 800M, as Dask reads it."""
    return f"{size}MiB" if size[-1].isdigit() else f"{size}iB"


@contextmanager
def local_cluster(
    workers: int,
    *,
    patience: float = 60.0,
    scratch: Path | None = None,
    memory_limit: str | None = None,
    meanwhile: Callable[[], object] | None = None,
) -> Iterator[Client]:
    """Start one-thread worker processes on this machine and give a client of them.

    Scheduler and workers listen on the loopback interface only. They show no dashboards: loading
    Bokeh would take each of these processes a second, and `status` and `watch` read the store.

    workers: number of worker processes; 0 means one per core.
    patience: seconds after which a worker that gives no sign of life is replaced.
    scratch: folder for the workers' own files; a temporary one by default.
    memory_limit: memory at which a worker is ended and replaced. By default, the memory of the
        machine, container or batch job divided by the number of workers.
    meanwhile: what to do in a thread while the workers start: this process only waits for them.
    """
    import dask
    from distributed import Client, Nanny, SpecCluster

    if meanwhile is not None:
        threading.Thread(target=meanwhile, daemon=True).start()

    number = workers or usable_cores()
    # As `NO_DASHBOARD` says it on a command line.
    listening = {"host": LOOPBACK, "dashboard": False, "dashboard_address": f"{LOOPBACK}:0"}
    worker = {
        "cls": Nanny,
        "options": {
            **listening,
            "nthreads": 1,
            "memory_limit": memory_limit or share_of_memory(number),
            "local_directory": None if scratch is None else str(scratch),
            "silence_logs": logging.CRITICAL,
        },
    }
    method = {"distributed.worker.multiprocessing-method": None}
    with dask.config.set(settings(patience) | method), start_method(start_fork_server()):
        with signals_blocked():
            cluster = SpecCluster(
                scheduler={"cls": _calm_scheduler(patience), "options": listening},
                workers=dict.fromkeys(range(number), worker),
                silence_logs=logging.CRITICAL,
            )
        try:
            with Client(cluster) as client:
                _prepare(client)
                try:
                    yield client
                except KeyboardInterrupt:
                    _kill_workers(cluster)
                    raise
        finally:
            _close(cluster)


@contextmanager
def existing_cluster(scheduler_file: Path, *, patience: float = 60.0) -> Iterator[Client]:
    """Connect to a scheduler that is running already, or will be, by the file it writes.

    Raises BadInput when no scheduler answers within ``patience`` seconds.
    """
    import dask

    with dask.config.set(settings(patience)), _connected(scheduler_file, patience) as client:
        _prepare(client)
        yield client


def _connected(scheduler_file: Path, patience: float) -> Client:
    from distributed import Client

    deadline = time.monotonic() + patience
    while True:
        # Each try reads the file again: another scheduler may have been started meanwhile.
        try:
            address = json.loads(scheduler_file.read_bytes())["address"]
            return Client(address, timeout=min(patience, 5.0))
        except (OSError, TimeoutError, ValueError, LookupError, TypeError) as error:
            if time.monotonic() > deadline:
                text = f"{scheduler_file}: its scheduler does not answer: {error}"
                raise BadInput(text) from None
            time.sleep(0.5)


def _calm_scheduler(patience: float) -> type[Scheduler]:
    """Return a scheduler to which workers send a heartbeat less often than twice per second.

    Each time takes 3 ms of the cores that integrate.
    """
    from distributed import Scheduler

    class CalmScheduler(Scheduler):
        def heartbeat_worker(self, *args: Any, **kwargs: Any) -> dict[str, Any]:
            answer: dict[str, Any] = super().heartbeat_worker(*args, **kwargs)
            if _INTERVAL in answer:
                answer[_INTERVAL] = max(answer[_INTERVAL], min(_HEARTBEAT_SECONDS, patience / 12))
            return answer

    return CalmScheduler


def _prepare(client: Client) -> None:
    from chimera_hpc.run.worker import SignalPlugin

    # What goes wrong is said by the run, on one line.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client.register_plugin(SignalPlugin())
    except Exception as error:
        # Workers that another program has started: they may lack anything.
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise BadInput(f"the workers cannot use this package: {text}") from None


def _close(cluster: SpecCluster) -> None:
    """Close a cluster; give up on one that does not close, for example after a lost worker."""
    try:
        cluster.close(timeout=_CLOSE_SECONDS)
    except TimeoutError:
        _kill_workers(cluster)


def _kill_workers(cluster: SpecCluster) -> None:
    """End all workers at once; their current blocks are lost."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.process is not None and nanny.process.pid:
            _kill(nanny.process.pid)


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
