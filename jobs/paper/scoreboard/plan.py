"""The jobs of the paper, the order in which they are run, and how --quick thins them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from chimera_hpc.job import Sweep
from chimera_hpc.job.registry import DEFAULT_PANEL
from chimera_hpc.job.shipped import jobs_folder

JOBS = (
    "diagonal",
    "orientation2",
    "networks",
    "networks-2",
    "synthetic",
    "stability",
    "typical",
    "subclasses",
    "still",
    "excitability",
    "timescale",
    "robustness-1",
    "robustness-2",
    "robustness-random",
    "robustness-node",
    "networked",
    "plane",
    "basin",
    "basin-200",
    "excitability-12",
    "plane-10",
)
"""A job comes after those whose atlas it asks for. New ones come last: a place seeds an audit."""

_FIRST = ("diagonal", "orientation2", "plane", "basin-200", "basin")
"""Jobs to run first: those that others ask for, then the longest; short ones fill the gaps."""

TRIPLETS = tuple(
    name
    for name in JOBS
    if name not in ("networks", "networks-2", "synthetic", "stability", "basin", "basin-200")
)
"""Jobs whose claims stand on triplets. Those of the others do not depend on the convention."""
PRINTED = "paper-printed"
"""The second convention that the claims are judged by, next to the default."""
_PANEL = f"measures.panel={json.dumps([*DEFAULT_PANEL, PRINTED])}"

QUICK: dict[str, tuple[str, ...]] = {
    "diagonal": ("seeds=5",),
    "orientation2": ("P=[9,12,13,14,15,17,18,22]", "seeds=3"),
    "stability": ("P=[1,2,6,12]",),
    "typical": ("seeds=6",),
    "subclasses": ("P=[7,21]", "seeds=2"),
    "still": ("seeds=3",),
    "excitability": ("b=[0.5,2.1]", "seeds=2"),
    "excitability-12": ("b=[0.5]", "decide.first=2", "decide.batch=2", "decide.most=4"),
    "timescale": ("P=[12]", "epsilon=[0.02,0.05,0.1]", "seeds=3"),
    "robustness-1": ("flips=[0,160]", "seeds=3"),
    "robustness-2": ("flips=[0,325]", "seeds=3"),
    "robustness-random": ("flips=[0]", "seeds=2"),
    "robustness-node": ("flips=[0]", "seeds=2"),
    "networked": ("sigma=[0.1,0.15,0.5]", "seeds=2"),
    "plane": ("P=[10,12]", "seeds=1"),
    "plane-10": ("Q=[4]", "decide.first=2", "decide.batch=2", "decide.most=4"),
    "basin": ("P=[1,20]", "delta=[0.2,0.5,1.2]", "seeds=3"),
    "basin-200": ("P=[1,20]", "delta=[0.2,0.5,1.2]", "seeds=3"),
}
"""Overrides of --quick."""


def settings(name: str, quick: bool) -> tuple[str, ...]:
    """Return the overrides of a job: both conventions are measured of the same runs."""
    return (*((_PANEL,) if name in TRIPLETS else ()), *(QUICK.get(name, ()) if quick else ()))


def running_order(names: Sequence[str]) -> list[str]:
    """Return jobs in the order in which they start."""
    return [
        *(name for name in _FIRST if name in names),
        *(name for name in names if name not in _FIRST),
    ]


def job_files(folder: str | Path) -> dict[str, Path]:
    """Return the job files by their names."""
    return {name: Path(folder) / f"{name}.toml" for name in JOBS}


def needs(name: str) -> tuple[str, ...]:
    """Return the jobs whose classes judge the runs of a job."""
    return load(name, jobs_folder() / "paper").reduction.atlas


def load(name: str, folder: str | Path, quick: bool = False) -> Sweep:
    """Return the sweep of a job."""
    return Sweep.load(job_files(folder)[name], settings(name, quick))
