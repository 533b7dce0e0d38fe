"""How firm the labels of the paper's jobs are: each is audited like any sweep."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.reduction.audit import Sample, audit_sweep
from chimera_hpc.reduction.audit_runs import WAYS
from chimera_hpc.reduction.results import read_results
from chimera_hpc.store.labelled import STORE_NAME
from scoreboard.plan import JOBS

_SHORT = ("networks", "networks-2", "synthetic", "stability")
"""Jobs without classes."""
_BASINS = ("basin", "basin-200")
"""Jobs whose runs say where they are at a fixed time: a longer one answers another question."""
_SEED = 20

Say = Callable[[str], None]


def audit_jobs(
    folder: Path, names: Sequence[str], share: float, workers: int, say: Say
) -> dict[str, Any]:
    """Audit jobs that lie beside each other; one entry a job, as its results.json has it.

    Each worker audits whole jobs: most are too short for workers of their own.
    """
    chosen = [n for n in names if n not in _SHORT and (folder / n / STORE_NAME).is_dir()]
    found = {}
    with _pool(min(workers, len(chosen))) as pool:
        made = {name: pool.submit(_audit, folder, name, share) for name in chosen}
        for name, audit in made.items():
            try:
                found[name] = audit.result()
            except BadInput as error:
                say(f"audit {name}: {error}")
            else:
                say(f"audit {name}: {_line(found[name])}")
    return found


def _pool(workers: int) -> Executor:
    if workers < 2:
        return ThreadPoolExecutor(1)
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


def _audit(folder: Path, name: str, share: float) -> dict[str, Any]:
    sample = Sample(share, seed=_SEED + JOBS.index(name))
    ways = tuple(way for way in WAYS if way != "longer" or name not in _BASINS)
    return audit_sweep(folder / name, sample, ways=ways)


def audits_under(folder: Path, names: Sequence[str], convention: str) -> dict[str, Any]:
    """Return what `audit_jobs` found of the labels under another convention, by the same runs."""
    read = {name: read_results(folder / name / convention / "results.json") for name in names}
    return {name: results["audit"] for name, results in read.items()}


def _line(entry: dict[str, Any]) -> str:
    parts = [f"{made['changed']} {way}" for way, made in entry["ways"].items()]
    return f"of {entry['points']} points changed: {', '.join(parts)}"
