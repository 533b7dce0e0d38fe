"""The text of the batch scripts, one for each way to run a sweep under SLURM.

Each script ends in ``exec python ...``, so that signals reach the program itself and its exit
status is the job's.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path

from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.fork_server import ONE_THREAD
from chimera_hpc.run.slurm.walltime import DRAIN

MODES = ("array", "allocation", "jobqueue")
WORKERS = 4
ARRAY = 16
TIME, MEMORY = "60", "1G"
"""Defaults: minutes, and memory of a worker."""
LOGS = "slurm"
"""Folder of scripts and logs inside a sweep's folder."""
_PREFIX = "chimera"
_PLAIN = re.compile(r"[\w./,:=+%@-]+", re.ASCII)


def job_name(store: Path, what: str = "") -> str:
    """Return the name of the jobs that work on a store: ``chimera-<digest of its path>-<what>``.

    `cancel` finds jobs that are left over by this name.
    """
    digest = blake2b(str(store.resolve()).encode(), digest_size=5).hexdigest()
    return f"{_PREFIX}-{digest}-{what}"


def environment_lines() -> list[str]:
    """Return the shell lines that every job begins with.

    No module of the current folder in place of a library. One thread per process. Compiled kernels
    in the user's cache folder, apart for each node, where no one else can write. Scratch where the
    site wants it.
    """
    threads = " ".join(f"{name}={value}" for name, value in ONE_THREAD.items())
    node = "${SLURMD_NODENAME:-$(hostname -s)}"
    kernels = "${XDG_CACHE_HOME:-$HOME/.cache}/chimera_hpc/numba-" + node
    return [
        f"export PYTHONSAFEPATH=1 {threads}",
        f'export NUMBA_CACHE_DIR="${{NUMBA_CACHE_DIR:-{kernels}}}"',
        'export DASK_TEMPORARY_DIRECTORY="${TMPDIR:-/tmp}"',
    ]


def compile_line(python: str, store: Path) -> str:
    """Return the shell line that compiles the kernels: the first job of a node does, others wait.

    Where there is no lock to be had, each job compiles for itself.
    """
    warm = shlex.join([python, "-m", "chimera_hpc.run.slurm.warm", str(store)])
    return f'mkdir -p "$NUMBA_CACHE_DIR" && flock -w 900 "$NUMBA_CACHE_DIR" {warm} || true'


@dataclass(frozen=True)
class Target:
    """What the jobs work on."""

    job: Path
    """The job file."""
    folder: Path
    """The sweep's folder."""
    name: str
    """Name of the SLURM job."""
    python: str = sys.executable
    logs: Path | None = None
    """Folder of the logs; the current one by default."""
    resubmit: int = 0
    drain: float | None = None
    overrides: tuple[str, ...] = ()
    planned: bool = True
    """Whether the store exists when the job is submitted."""

    def command(self, *words: str) -> str:
        """Return the line that runs a command of the sweep in place of the shell."""
        return f"exec {shlex.join([self.python, '-m', 'chimera_hpc.sweep', *words])}"

    def again(self) -> tuple[str, ...]:
        """Return the options for going on after the time limit."""
        return ("--resubmit", str(self.resubmit)) if self.resubmit else ()

    def words(self) -> list[str]:
        """Return what tells the sweep: the job file with what overrides it, and the folder."""
        sets = [word for text in self.overrides for word in ("--set", text)]
        return [str(self.job), "--out", str(self.folder), *sets]

    def run(self, *words: str) -> str:
        return self.command("run", *self.words(), *words)


def array_script(target: Target, slurm_options: Slurm) -> str:
    """Return a job array: each element does its share of the blocks, without a scheduler."""
    n = slurm_options.array or ARRAY
    most = f"%{slurm_options.at_once}" if slurm_options.at_once else ""
    options = [f"--array=0-{n - 1}{most}", "--ntasks=1", f"--mem={slurm_options.mem or MEMORY}"]
    what = [str(target.folder)] if target.planned else target.words()
    lines = [
        compile_line(target.python, target.folder if target.planned else target.job),
        target.command("shard", *what, "--of", str(n), *target.again()),
    ]
    return _script(target, slurm_options, options, "\n".join(lines), "%A_%a")


def allocation_script(target: Target, slurm_options: Slurm) -> str:
    """Return one job that holds driver, scheduler and workers."""
    memory = slurm_options.mem or MEMORY
    options = [
        f"--ntasks={slurm_options.workers or WORKERS}",
        f"--mem-per-cpu={memory}",
        "--no-kill",
    ]
    words = [
        "--cluster",
        "allocation",
        "--mem",
        memory,
        *_interface(slurm_options),
        *target.again(),
    ]
    return _script(target, slurm_options, options, target.run(*words), "%j")


def jobqueue_script(target: Target, slurm_options: Slurm) -> str:
    """Return a small job that holds the driver, which submits a job for each worker.

    For sites whose login nodes are not for programs that run for long.
    """
    names = ("partition", "account", "time", "mem", "workers", "interface")
    given = [(f"--{name}", getattr(slurm_options, name)) for name in names]
    words = [str(word) for option in given if option[1] is not None for word in option]
    options = ["--ntasks=1", "--mem=2G"]
    command = target.run("--cluster", "slurm", *words, *target.again())
    return _script(target, slurm_options, options, command, "%j")


def reduce_script(target: Target, slurm_options: Slurm) -> str:
    """Return the job that reduces a sweep after the others, if every point was tried."""
    options = ["--ntasks=1", "--mem=4G"]
    words = ["reduce", str(target.folder), "--complete"]
    return _script(target, slurm_options, options, target.command(*words), "%j")


def worker_request(store: Path, slurm_options: Slurm) -> str:
    """Return a script that asks for what the job of one worker asks for, to be tested only."""
    target = Target(store, store.parent, job_name(store, "test"))
    options = ["--ntasks=1", f"--mem={slurm_options.mem or MEMORY}"]
    return _script(target, slurm_options, options, "true", "%j")


SCRIPTS = {
    "array": array_script,
    "allocation": allocation_script,
    "jobqueue": jobqueue_script,
    "reduce": reduce_script,
}


def templates() -> dict[str, str]:
    """Return the scripts that the project carries ready-made, by name, for the quickstart job."""
    job, folder = Path("jobs/quickstart.toml"), Path("results/quickstart")
    target = Target(job, folder, "", python="python", planned=False)
    return {
        name: make(replace(target, name=f"chimera-quickstart-{name}"), Slurm.model_validate({}))
        for name, make in SCRIPTS.items()
    }


def _script(
    target: Target, slurm_options: Slurm, options: Sequence[str], command: str, number: str
) -> str:
    log = f"%x-{number}.log"
    header = [
        f"--job-name={target.name}",
        *options,
        "--cpus-per-task=1",
        f"--time={slurm_options.time or TIME}",
        f"--output={target.logs / log if target.logs else log}",
        # A job that is put back into the queue goes on where it was, in the same log.
        "--open-mode=append",
        "--requeue",
        *(
            f"--{name}={value}"
            for name in ("partition", "account")
            if (value := _of(slurm_options, name))
        ),
        *slurm_options.extra,
    ]
    drain = [] if target.drain is None else [f"export {DRAIN}={target.drain:g}"]
    lines = [
        "#!/bin/bash",
        *(f"#SBATCH {_quoted(option)}" for option in header),
        *environment_lines(),
        *drain,
        *slurm_options.setup,
        command,
    ]
    return "\n".join(lines) + "\n"


def _of(slurm_options: Slurm, name: str) -> str | None:
    value: str | None = getattr(slurm_options, name)
    return value


def _interface(slurm_options: Slurm) -> list[str]:
    return ["--interface", slurm_options.interface] if slurm_options.interface else []


def _quoted(option: str) -> str:
    name, sign, value = option.partition("=")
    if not sign or _PLAIN.fullmatch(value) or " --" in value:
        return option
    return f'{name}="{value}"'
