"""A Dask cluster inside one SLURM job: the driver holds the scheduler, `srun` starts workers."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.local_cluster import LOOPBACK, NO_DASHBOARD, dask_size, settings
from chimera_hpc.run.slurm.queue import KERNELS, is_of_this_node
from chimera_hpc.run.slurm.script import LOGS, MEMORY, environment_lines, job_name
from chimera_hpc.run.slurm.tls import fresh_certificate
from chimera_hpc.run.slurm.workers import Say, check_interface, tunnel, worker_settings

if TYPE_CHECKING:
    from distributed import Client

_END_SECONDS = 5.0


@contextmanager
def allocation_cluster(
    slurm_options: Slurm, store: Path, say: Say, patience: float = 60.0
) -> Iterator[Client]:
    """Start a scheduler here and a worker for each task of this job; give a client of it.

    Raises BadInput outside of a SLURM job.
    """
    if "SLURM_JOB_ID" not in os.environ:
        raise BadInput("--cluster allocation: works inside a SLURM job only; see the command slurm")
    check_interface(slurm_options)
    import dask
    from distributed import Client, LocalCluster
    from distributed.utils import get_ip

    job = os.environ["SLURM_JOB_ID"]
    logs = store.parent / LOGS
    logs.mkdir(exist_ok=True)
    where = (
        {"interface": slurm_options.interface} if slurm_options.interface else {"host": get_ip()}
    )
    restarts = os.environ.get("SLURM_RESTART_COUNT", "0")
    with (
        dask.config.set(settings(patience)),
        fresh_certificate(job_name(store, f"{job}-{restarts}-{os.getpid()}"), store) as certificate,
        LocalCluster(
            n_workers=0,
            protocol="tls://",
            security=certificate.security(),
            dashboard_address=f"{LOOPBACK}:0",
            silence_logs=logging.CRITICAL,
            **where,
        ) as cluster,
        Client(cluster) as client,
    ):
        from chimera_hpc.run.worker import SignalPlugin

        client.register_plugin(SignalPlugin())
        say(tunnel(cluster.scheduler))
        address = [cluster.scheduler_address, *certificate.worker_arguments()]
        with _workers(store, address, slurm_options, logs / f"workers-{job}.log"):
            yield client
            client.retire_workers(close_workers=True)


@contextmanager
def _workers(store: Path, address: list[str], slurm_options: Slurm, log: Path) -> Iterator[None]:
    """Start the workers in one step, after each node has compiled the kernels once."""
    memory = slurm_options.mem or MEMORY
    step = ["srun", f"--mem-per-cpu={memory}", "--kill-on-bad-exit=0", "--cpus-per-task=1"]
    nodes = os.environ.get("SLURM_JOB_NUM_NODES", "1")
    compile_once = [*step, f"--nodes={nodes}", f"--ntasks={nodes}", "--ntasks-per-node=1"]
    worker = [
        *(sys.executable, "-m", "distributed.cli.dask_worker", *address),
        *("--nthreads", "1", "--memory-limit", dask_size(memory), "--death-timeout", "60"),
        *NO_DASHBOARD,
        *(["--interface", slurm_options.interface] if slurm_options.interface else []),
    ]
    with log.open("ab") as out:
        streams: dict[str, Any] = {"stdout": out, "stderr": out, "stdin": subprocess.DEVNULL}
        warm = [sys.executable, "-m", "chimera_hpc.run.slurm.warm", str(store)]
        subprocess.run([*compile_once, *_on_its_node(warm)], check=False, **streams)
        srun = subprocess.Popen([*step, *_on_its_node(worker, *worker_settings())], **streams)
        try:
            yield
        finally:
            _end(srun)


def _on_its_node(words: list[str], *lines: str) -> list[str]:
    """Return a command that sets up the environment on the node where it comes to run."""
    # What this process found out holds for the first node.
    forget = [f"unset {KERNELS}"] if is_of_this_node(os.environ.get(KERNELS, "")) else []
    script = "; ".join([*forget, *environment_lines(), *lines, 'exec "$@"'])
    return ["bash", "-c", script, "bash", *words]


def _end(srun: subprocess.Popen[bytes]) -> None:
    try:
        srun.wait(_END_SECONDS)
    except subprocess.TimeoutExpired:
        srun.terminate()
        srun.wait()
