"""Small sweeps, the command line as its own process, and how stores compare."""

from __future__ import annotations

import io
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from jobs_for_tests import SMALL, job_text

from chimera_hpc.store.ledger import read_ledger
from chimera_hpc.sweep import main

JOB = SMALL | {
    "grid.P": "2:5",
    "grid.seeds": 16,
    "integrator.t_end": 100.0,
    "features.start": 40.0,
    "features.n_peaks": None,
    "features.n_overlap": None,
    "reduction.figures": [],
    "keep.series": "none",
    "run.patience": 20.0,
    "slurm.interface": "lo",
    "slurm.mem": "700M",
    "slurm.time": "5",
    "slurm.workers": 2,
    "slurm.array": 4,
}
"""64 points."""


LONG = 12_000.0
"""Time of runs that let a sweep last for five to ten seconds on two cores: a signal that is sent
after the first points comes before the last ones."""


def write_job(
    folder: Path, t_end: float = 100.0, block: int = 4, model: str = "topological_fhn"
) -> Path:
    """Write a job of 64 points."""
    path = folder / "small.toml"
    changes = {"integrator.t_end": t_end, "run.block": block, "model": model}
    # The ring of the fault harness has no Q.
    own = {"grid.Q": None} if ":" in model else {}
    path.write_text(job_text(JOB, changes | own))
    return path


def command(*words: object) -> list[str]:
    """Return the command line of the sweep's program."""
    return [sys.executable, "-m", "chimera_hpc.sweep", *map(str, words)]


def sweep(*words: object, timeout: float = 240) -> subprocess.CompletedProcess[str]:
    """Run a command of the sweep in a process of its own."""
    return subprocess.run(
        command(*words), capture_output=True, text=True, timeout=timeout, check=False
    )


def sweep_here(*words: object) -> subprocess.CompletedProcess[str]:
    """Run a command of the sweep in this process, which takes two seconds less."""
    texts = [str(word) for word in words]
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as errors:
        code = main(texts)
    return subprocess.CompletedProcess(texts, code, out.getvalue(), errors.getvalue())


def digests(folder: Path) -> np.ndarray[Any, Any]:
    """Return the digest of every point in a sweep's folder."""
    return read_ledger(folder / "store.zarr")["digest"]


def rows_done(folder: Path) -> dict[int, tuple[int, ...]]:
    """Return the ledger's rows of the points that have an end, times and run included, by point."""
    columns = read_ledger(folder / "store.zarr")
    done = np.flatnonzero(columns["status"] != 255)
    return {int(i): tuple(int(column[i]) for column in columns.values()) for i in done}


def n_done(folder: Path) -> int:
    """Return how many points have an end, good or bad."""
    return int((read_ledger(folder / "store.zarr")["status"] != 255).sum())


def logs(folder: Path) -> str:
    """Return all logs of a sweep's jobs."""
    return "\n".join(p.read_text() for p in sorted((folder / "slurm").glob("*.[loe][our][gtr]")))
