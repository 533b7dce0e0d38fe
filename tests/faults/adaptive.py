"""Kill the rounds of a sweep with [decide] again and again, and compare its end with another one.

    python tests/faults/adaptive.py --kills 20              # two `run` at once on one store
    python tests/faults/adaptive.py --kills 20 --workers    # one with two workers
    python tests/faults/adaptive.py --kills 20 --slurm      # a job array of two, by a real SLURM

The undisturbed sweep is run by one process. Locally every third kill takes all drivers, and every
second one their workers too. Of an array one element is killed at a time, and submitted again.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))
from jobs_for_tests import SMALL, job_text
from lab import Child, command, fork
from slurm_real import Slurm
from slurm_sweeps import sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.points import point_keys
from chimera_hpc.store.store import Store

JOB = job_text(
    SMALL,
    {
        "name": "adaptive",
        "model": "trouble:MODEL",
        "grid.P": "2:5",
        "grid.Q": None,
        "grid.seeds": None,
        "fixed.n_nodes": None,
        "reduction.cuts": [2],
        "reduction.figures": [],
        "run.block": 2,
        "decide.confidence": 1 - 1e-12,
        "decide.first": 5,
        "decide.batch": 5,
        "decide.most": 60,
        "slurm.interface": "lo",
        "slurm.mem": "900M",
        "slurm.time": "30",
    },
)
"""So sure of a class that each cell takes some ten rounds."""
POINT_SECONDS = 1.0
"""A point sleeps: a machine with other work does not change where the kills fall."""


def same(folder: Path, other: Path) -> bool:
    """Return whether two sweeps have the same points, digests, and rounds in the last spec."""
    ours, theirs = (Store.open(place / "store.zarr") for place in (folder, other))
    keys = point_keys(ours.points).tolist() == point_keys(theirs.points).tolist()
    digests = ours.ledger()["digest"].tolist() == theirs.ledger()["digest"].tolist()
    return keys and digests and ours.sweep.digest == theirs.sweep.digest


def state(folder: Path) -> str:
    """Return rounds, points and computed points of a sweep."""
    try:
        store = Store.open(folder / "store.zarr")
        done = int((store.ledger()["status"] != 255).sum())
    except (BadInput, OSError) as error:
        return str(error)
    return f"round {len(store.sweeps)}, {done} of {store.n_points} points"


def let_it_work(kill: int, out: Path, chance: random.Random, ended: Callable[[], object]) -> None:
    """Wait for a random moment: while processes start every fifth time, else of their work."""
    before, until = state(out), time.monotonic() + 90.0
    while kill % 5 and state(out) == before and time.monotonic() < until and not ended():
        time.sleep(0.2)
    time.sleep(chance.uniform(0.0, 6.0))


def killed_here(job: Path, out: Path, kills: int, chance: random.Random, workers: bool) -> int:
    """Run with two workers, or twice at once, until it ends; return how many kills it took."""
    words = ["run", str(job), "--out", str(out), "--no-figures"]
    how = [["--workers", "2"]] if workers else [["--cluster", "serial"]] * 2
    slow = {"TROUBLE_SECONDS": str(POINT_SECONDS)}
    crew: list[Child] = []
    for kill in range(kills):
        crew = [each for each in crew if each.poll() is None]
        for k in range(len(crew), len(how)):
            output = job.with_name(f"run-{kill}-{k}.txt")
            crew.append(Child(fork(partial(command, iter(words + how[k])), output, slow), output))
        let_it_work(kill, out, chance, lambda: any(each.poll() == 0 for each in crew))  # noqa: B023
        if any(each.poll() == 0 for each in crew):
            return kill
        for victim in crew if kill % 3 == 0 else crew[:1]:
            (victim.signal if kill % 2 else victim.signal_group)(signal.SIGKILL)
            victim.wait()
        print(f"kill {kill + 1}: {state(out)}", flush=True)
    for each in crew:
        each.signal_group(signal.SIGKILL)
    return kills


def killed_elements(slurm: Slurm, job: Path, out: Path, kills: int, chance: random.Random) -> int:
    """Run a job array of two elements until it ends; return how many were killed."""
    words = ("slurm", job, "--out", out, "--mode", "array", "--array", 2, "--no-reduce", "--submit")
    done = sweep(*words)
    print(done.stdout, done.stderr)
    for kill in range(kills):
        let_it_work(kill, out, chance, lambda: not slurm.queue())
        elements = [line[0] for line in slurm.queue() if line[1] == "RUNNING"]
        if not elements:
            return kill
        element = chance.choice(elements)
        slurm.sh("scancel", "--signal=KILL", "--full", element)
        slurm.until(lambda lost=element: lost not in _running(slurm), 60, "the element did not end")
        print(f"kill {kill + 1} of {element}: {state(out)}", flush=True)
        slurm.sh("sbatch", f"--array={element.split('_')[1]}", str(out / "slurm" / "array.sbatch"))
    return kills


def _running(slurm: Slurm) -> list[str]:
    return [line[0] for line in slurm.queue()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--workers", action="store_true")
    parser.add_argument("--slurm", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    folder, chance = Path(tempfile.mkdtemp(prefix="adaptive-")), random.Random(args.seed)
    job, alone, out = folder / "job.toml", folder / "alone", folder / "out"
    job.write_text(JOB)
    folder.chmod(0o755)
    shutil.copy(Path(__file__).with_name("trouble.py"), folder)
    sweep("run", job, "--out", alone, "--cluster", "serial", "--no-figures", timeout=1800)
    print("undisturbed:", state(alone), flush=True)
    began = time.monotonic()
    if args.slurm:
        # Nodes of a real cluster have kernels of their own; here the undisturbed sweep left them.
        kernels = Path.home() / ".cache" / "chimera_hpc" / "numba"
        os.environ.setdefault("NUMBA_CACHE_DIR", str(kernels))
        slurm = Slurm()
        os.environ["TROUBLE_SECONDS"] = str(POINT_SECONDS)
        os.environ |= {"SLURM_CONF": str(slurm.conf), "CHIMERA_HPC_PRIVATE": str(folder / "own")}
        try:
            kills = killed_elements(slurm, job, out, args.kills, chance)
            slurm.wait(1800)
        finally:
            slurm.stop()
    else:
        kills = killed_here(job, out, args.kills, chance, args.workers)
    ended = sweep("run", job, "--out", out, "--cluster", "serial", "--no-figures", timeout=1800)
    print(f"{kills} kills in {time.monotonic() - began:.0f} s; {state(out)}; {folder}")
    print("same points and digests" if same(out, alone) else "OTHER POINTS OR DIGESTS")
    return 0 if ended.returncode == 0 and same(out, alone) else 1


if __name__ == "__main__":
    sys.exit(main())
