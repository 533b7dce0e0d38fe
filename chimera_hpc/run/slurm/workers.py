"""A Dask cluster whose workers are SLURM jobs: one process each, replaced when it is lost.

dask-jobqueue 0.9 submits the jobs. This module adds what it lacks: it reports a job that was
refused, that waits, or that ended without its worker; it replaces a lost job; and it waits for a
job that SLURM has requeued.
"""

from __future__ import annotations

import asyncio
import logging
import signal
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.places import user_name
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.local_cluster import LOOPBACK, NO_DASHBOARD, dask_size, settings
from chimera_hpc.run.slurm import queue
from chimera_hpc.run.slurm.queue import SlurmFailed
from chimera_hpc.run.slurm.script import (
    LOGS,
    MEMORY,
    TIME,
    WORKERS,
    compile_line,
    environment_lines,
    job_name,
    worker_request,
)
from chimera_hpc.run.slurm.tls import Certificate, fresh_certificate
from chimera_hpc.run.slurm.walltime import WORKER

if TYPE_CHECKING:
    from distributed import Client

_LOOK_SECONDS = 1.0
"""How often the workers are counted, which costs nothing."""
_FIRST_PAUSE, _LONGEST_PAUSE = 2.0, 30.0
"""Pauses between questions to SLURM while workers are missing."""
_BOOKS_SECONDS = 0.5
_EXTRA = "--cluster slurm needs the extra: pip install 'chimera_hpc[slurm]'"
Say = Callable[[str], None]


class Keeper(threading.Thread):
    """Keeps the number of worker jobs up, and tells what they wait for."""

    def __init__(self, cluster: Any, name: str, wanted: int, say: Say, logs: Path) -> None:
        """Look after ``wanted`` jobs called ``name``; ``say`` takes lines for people."""
        super().__init__(daemon=True)
        self.cluster, self.name_of_jobs, self.wanted = cluster, name, wanted
        self.say, self.logs = say, logs
        self.failure: str | None = None
        self._over = threading.Event()
        self._told: str | None = None
        self._lost = 0

    def run(self) -> None:
        """Count the workers until `close`; ask SLURM about those that are not there.

        It is asked soon when one is lost, and less and less often about jobs that wait.
        """
        pause, asked, before = _FIRST_PAUSE, time.monotonic(), 0
        while not self._over.wait(_LOOK_SECONDS):
            there = len(self.cluster.scheduler.workers)
            if there >= self.wanted or there < before:
                pause = _FIRST_PAUSE
            before = there
            if there >= self.wanted or time.monotonic() - asked < pause:
                continue
            try:
                waiting = self._look(there)
            except (SlurmFailed, BadInput) as error:
                waiting = True
                self._tell(str(error))
            asked = time.monotonic()
            pause = min(2 * pause, _LONGEST_PAUSE) if waiting else _FIRST_PAUSE

    def close(self) -> None:
        self._over.set()

    def coming(self) -> bool:
        """Return whether workers may still come; raise BadInput when they keep ending at once."""
        if self.failure is not None:
            raise BadInput(self.failure)
        return True

    def _look(self, there: int) -> bool:
        """Replace jobs that have ended; return whether the missing workers are waited for."""
        if there:
            self._lost = 0
        wished = set(self.cluster.worker_spec)
        mine = [(n, job) for n, job in list(self.cluster.workers.items()) if n in wished]
        queued = {job.id: job for job in queue.jobs(self.name_of_jobs)}
        refused = [job.refused for _, job in mine if job.refused]
        dead = [n for n, job in mine if job.refused or (job.job_id and job.job_id not in queued)]
        waiting = Counter(job.reason for job in queued.values() if job.state == "PENDING")
        if waiting:
            reasons = ", ".join(f"{count} for {reason}" for reason, count in waiting.items())
            self._tell(f"{there} of {self.wanted} workers; jobs that wait: {reasons}")
        if refused:
            self._tell(refused[0])
        if dead:
            self._lost += len(dead)
            self.say(f"worker jobs that have ended are replaced: {len(dead)}")
            self.cluster.loop.add_callback(self._replace, dead)
        if self._lost > 2 * self.wanted + 2:
            ended = f"{self._lost} worker jobs ended without a worker; see {self.logs}"
            self.failure = refused[0] if refused else ended
        return bool(refused or (waiting and not dead))

    def _replace(self, dead: list[Any]) -> None:
        """Forget dead jobs and submit others; in the event loop's own thread."""
        for name in dead:
            self.cluster.worker_spec.pop(name, None)
        # Dask gives a free name again: the dead must be gone from its books before that.
        self.cluster.scale(jobs=len(self.cluster.worker_spec))
        self.cluster.loop.call_later(_BOOKS_SECONDS, self._fill_up)

    def _fill_up(self) -> None:
        if not self._over.is_set():
            self.cluster.scale(jobs=self.wanted)

    def _tell(self, line: str) -> None:
        if line != self._told:
            self._told = line
            self.say(line)


def check_options(slurm_options: Slurm, store: Path) -> None:
    """Ask, before anything is begun, whether SLURM would take the job of a worker.

    Raises BadInput when it would not, or what is needed here is not there.
    """
    check_interface(slurm_options)
    queue.check(worker_request(store, slurm_options))
    if any(find_spec(name) is None for name in ("dask_jobqueue", "cryptography")):
        raise BadInput(_EXTRA)


def check_interface(slurm_options: Slurm) -> None:
    """Raise BadInput when this machine has no such network interface."""
    known = [name for _, name in socket.if_nameindex()]
    if slurm_options.interface is not None and slurm_options.interface not in known:
        raise BadInput(
            f"interface {slurm_options.interface}: not here; allowed: {', '.join(known)}"
        )


@contextmanager
def slurm_cluster(
    slurm_options: Slurm, store: Path, blocks: int, say: Say, patience: float = 60.0
) -> Iterator[tuple[Client, Keeper]]:
    """Start a scheduler here and one-process workers in jobs of their own; give a client of it.

    Traffic is under TLS with a certificate of this run alone; the dashboard listens on loopback.

    store: what the workers work on: names of jobs and the folder of logs follow from it.
    blocks: blocks to be done; more workers are not asked for.
    say: takes lines for people.
    patience: seconds after which a worker that gives no sign of life is given up.

    Raises BadInput when SLURM would refuse the workers' jobs.
    """
    import dask
    from distributed import Client

    wanted = max(1, min(slurm_options.workers or WORKERS, blocks))
    name = job_name(store, _mark())
    logs = store.parent / LOGS
    logs.mkdir(exist_ok=True)
    with (
        dask.config.set(settings(patience)),
        fresh_certificate(name, store) as certificate,
        _cluster(slurm_options, name, store, certificate) as cluster,
    ):
        queue.check(cluster.job_script())
        with Client(cluster) as client:
            _prepare(client)
            say(f"{wanted} worker jobs asked for; logs in {logs}")
            say(tunnel(cluster.scheduler))
            cluster.scale(jobs=wanted)
            keeper = Keeper(cluster, name, wanted, say, logs)
            keeper.start()
            try:
                yield client, keeper
            finally:
                keeper.close()


def tunnel(scheduler: Any) -> str:
    """Return how to reach the dashboard, which listens on loopback only."""
    port = scheduler.services["dashboard"].port if "dashboard" in scheduler.services else None
    port = port or scheduler.http_server.port
    here = f"{user_name()}@{socket.gethostname()}"
    return f"dashboard: ssh -N -L 8787:{LOOPBACK}:{port} {here}, then http://localhost:8787/status"


def _mark() -> str:
    """Return a mark that distinguishes this run's jobs from those of other runs on the store."""
    from chimera_hpc.base.processes import process_identity

    return process_identity()


def _prepare(client: Client) -> None:
    from chimera_hpc.run.worker import SignalPlugin

    client.register_plugin(SignalPlugin())


def _cluster(slurm_options: Slurm, name: str, store: Path, certificate: Certificate) -> Any:
    cluster, job = _classes()
    options = {"dashboard_address": f"{LOOPBACK}:0"}
    compile_once = compile_line(sys.executable, store)
    memory = slurm_options.mem or MEMORY
    told = [f"export {WORKER}=1", *worker_settings()]
    prologue = [*environment_lines(), *told, *slurm_options.setup, compile_once]
    return cluster(
        job_cls=job,
        cores=1,
        processes=1,
        memory=dask_size(memory),
        job_mem=memory,
        walltime=slurm_options.time or TIME,
        queue=slurm_options.partition,
        account=slurm_options.account,
        job_name=name,
        interface=slurm_options.interface,
        log_directory=str(store.parent / LOGS),
        job_script_prologue=prologue,
        job_extra_directives=["--requeue", "--open-mode=append", *slurm_options.extra],
        worker_extra_args=list(NO_DASHBOARD),
        scheduler_options=options,
        security=certificate.security(),
        silence_logs=logging.CRITICAL,
    )


def worker_settings() -> list[str]:
    """Return the shell lines that give a worker in another job Dask's settings."""
    theirs = ("distributed.worker.", "distributed.admin.")
    chosen = {k: v for k, v in settings().items() if k.startswith(theirs)}
    names = {k: "DASK_" + k.upper().replace(".", "__").replace("-", "_") for k in chosen}
    return [f"export {names[k]}={v}" for k, v in chosen.items()]


def _classes() -> tuple[Any, Any]:
    """Import dask-jobqueue, which takes SIGINT for itself, and give SIGINT back."""
    before = signal.getsignal(signal.SIGINT)
    try:
        from dask_jobqueue.slurm import SLURMCluster, SLURMJob
        from distributed.deploy.spec import ProcessInterface
    except ImportError:
        raise BadInput(_EXTRA) from None
    finally:
        signal.signal(signal.SIGINT, before)

    class Job(SLURMJob):
        """A worker's job, submitted with patience; a refusal is kept for the keeper."""

        refused: str | None = None

        async def start(self) -> None:
            with self.job_file() as script:
                try:
                    self.job_id = await asyncio.to_thread(queue.submit, Path(script))
                except BadInput as error:
                    self.refused, self.job_id = str(error), "0"
            # Its own start would submit the script once more.
            await ProcessInterface.start(self)

        async def close(self) -> None:
            if self.job_id and not self.refused:
                await asyncio.to_thread(_cancel, str(self.job_id))

    return SLURMCluster, Job


def _cancel(job: str) -> None:
    try:
        queue.cancel([job])
    except (SlurmFailed, BadInput):
        logging.getLogger(__name__).warning("job %s could not be cancelled", job)
