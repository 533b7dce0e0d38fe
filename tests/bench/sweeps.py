"""Whole commands: workers, overhead, memory, first point, the light commands, the plane."""

from __future__ import annotations

import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import psutil
from programs import SCALE, load_program
from single import Row, Scaling

ROOT = Path(__file__).parents[2]
PLANE = ROOT / "jobs" / "paper" / "plane.toml"
MB = 1e6
_SWEEP = (sys.executable, "-P", "-m", "chimera_hpc.sweep")
_BARE = """
import sys
from chimera_hpc.grid import Sweep
from chimera_hpc.grid.blocks import block_size, blocks
from chimera_hpc.task import run_block, warm_up

job, share, shares, *settings = sys.argv[1:]
sweep = Sweep.load(job, settings)
points = sweep.points()
warm_up(sweep, points)
print("begin", flush=True)
cuts = blocks(len(points), block_size(sweep, len(points)))
for start, stop in cuts[int(share) :: int(shares)]:
    run_block(sweep, points[slice(start, stop)])
print("end", flush=True)
"""


@dataclass(frozen=True)
class Watched:
    """A command that has ended."""

    seconds: float
    peak: float
    """Most memory that a process of it held, bytes."""
    first: float
    """Seconds until the first finished point; NaN where none was waited for."""
    blocks: float = float("nan")
    """Seconds that the workers of a sweep spent in its blocks, all together."""


def watched(
    command: list[str], store: Path | None = None, environment: dict[str, str] | None = None
) -> Watched:
    """Run a command, look at its processes' memory, and wait for the first point in `store`."""
    began = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment, text=True
    )
    peak, first, me = 0.0, float("nan"), psutil.Process(process.pid)
    while process.poll() is None:
        # The driver draws figures; what counts are the processes that integrate.
        for child in me.children(recursive=True):
            try:
                peak = max(peak, child.memory_info().rss)
            except psutil.NoSuchProcess:
                continue
        if store is not None and first != first and any((store / "ledger").glob("c.*")):
            first = time.perf_counter() - began
        time.sleep(0.02 if store is not None and first != first else 0.2)
    if process.returncode:
        assert process.stderr is not None
        raise SystemExit(f"{command} ended with {process.returncode}: {process.stderr.read()}")
    return Watched(time.perf_counter() - began, peak, first)


def bare(job: Path, shares: int, settings: list[str]) -> float:
    """Return the seconds that the blocks take without executor and store, in `shares` processes."""
    command = [sys.executable, "-P", "-c", _BARE, str(job)]
    processes = [
        subprocess.Popen(
            [*command, str(k), str(shares), *settings], stdout=subprocess.PIPE, text=True
        )
        for k in range(shares)
    ]
    began = ended = 0.0
    for process in processes:
        assert process.stdout is not None
        process.stdout.readline()
    began = time.perf_counter()
    for process in processes:
        assert process.stdout is not None
        with process.stdout as output:
            output.readline()
        process.wait()
        ended = time.perf_counter()
    return ended - began


def workers(
    folder: Path, settings: list[str], seeds: tuple[int, ...], scaling: Scaling
) -> list[Row]:
    """The plane with one worker and with two, and its blocks without executor and store."""
    options = [word for setting in settings for word in ("--set", setting)]
    # The first run is not measured: it may have to compile the kernels.
    for k, n in enumerate((seeds[0], *seeds)):
        out = folder / f"plane-seeds-{n}-{k}"
        command = [*_SWEEP, "run", str(PLANE), "--out", str(out), *options, "--set", f"seeds={n}"]
        seconds = watched([*command, "--workers", "2", "--no-figures"]).seconds
        if k > 0:
            scaling.points.append((_points(out), seconds))
    whole: dict[int, list[Watched]] = {1: [], 2: []}
    without: dict[int, list[float]] = {1: [], 2: []}
    # There and back again: a machine that slows down or speeds up meets both sides alike.
    for n, is_whole in ((2, True), (2, False), (1, True), (1, False), (2, False), (2, True)):
        if is_whole:
            out = folder / f"plane-{n}-{len(whole[n])}"
            command = [*_SWEEP, "run", str(PLANE), "--workers", str(n), "--out", str(out), *options]
            run = watched([*command, "--no-figures"])
            whole[n].append(replace(run, blocks=_in_blocks(out / "run.log")))
        else:
            without[n].append(bare(PLANE, n, settings))
    runs = {n: statistics.mean(run.seconds for run in found) for n, found in whole.items()}
    alone = {n: statistics.mean(seconds) for n, seconds in without.items()}
    full = watched([*_SWEEP, "run", str(PLANE), "--out", str(folder / "plane"), *options])
    gain, limit = runs[1] / runs[2], alone[1] / alone[2]
    cost = {n: runs[n] / alone[n] - 1.0 for n in (1, 2)}
    note = f"{runs[1]:.1f} s and {runs[2]:.1f} s; "
    note += f"without executor and store {alone[1]:.1f} s and {alone[2]:.1f} s ({limit:.2f} times)"
    both = f"1 worker {cost[1]:.1%}, 2 workers {cost[2]:.1%}: start, planning, reduction included; "
    within = {
        n: sum(run.seconds for run in found) / sum(run.blocks / n for run in found) - 1.0
        for n, found in whole.items()
    }
    both += "over the seconds that its own workers spent in blocks, whatever the machine's speed "
    both += f"from one run to the next, {within[1]:.1%} and {within[2]:.1%}"
    size = _points(folder / "plane")
    peak = max(run.peak for run in whole[2])
    scaling.workers = list(runs.items())
    scaling.points.append((size, runs[2]))
    return [
        Row("2 workers over 1, whole command", gain, "times", 1.9, True, note),
        Row("whole command over bare blocks, minus one", max(cost.values()), "", 0.05, False, both),
        Row("largest worker process", peak / MB, "MB", 320.0, False),
        Row(f"the {size}-point plane, 2 workers, figures included", full.seconds / 60, "minutes",
            6.0, False),
    ]  # fmt: skip


def _in_blocks(log: Path) -> float:
    return sum(map(float, re.findall(r"block \d+: .* failed, ([0-9.]+) s", log.read_text())))


def _points(out: Path) -> int:
    total: int = json.loads((out / "results.json").read_text())["points"]["total"]
    return total


def memory(t_ends: tuple[float, float]) -> list[Row]:
    """Growth of a process that integrates ten times as long."""
    peak_memory = load_program(SCALE, "scale_measurements").peak_memory
    peaks = []
    for t_end in t_ends:
        settings = ["P=12", "seeds=8", f"integrator.t_end={t_end}", f"features.start={t_end - 50}"]
        command = [sys.executable, "-P", "-c", _BARE, str(ROOT / "jobs" / "quickstart.toml")]
        process = subprocess.Popen([*command, "0", "1", *settings], stdout=subprocess.DEVNULL)
        peak = 0
        while process.poll() is None:
            peak = max(peak, peak_memory(process.pid))
            time.sleep(0.02)
        peaks.append(peak / MB)
    note = f"{peaks[0]:.0f} MB and {peaks[1]:.0f} MB; the analysis interval is 50 in both"
    what = f"growth of a worker from t_end {t_ends[0]:g} to {t_ends[1]:g}"
    return [Row(what, peaks[1] - peaks[0], "MB", 20.0, False, note)]


def starting(folder: Path, repeats: int) -> list[Row]:
    """First finished point with warm and with cold kernels; commands that only look."""
    job = str(ROOT / "jobs" / "quickstart.toml")
    rows = []
    for name, limit in (("warm", 5.0), ("cold", 40.0)):
        times = []
        for k in range(repeats if name == "warm" else 1):
            out, caches = folder / f"first-{name}-{k}", folder / "caches"
            environment = dict(os.environ)
            if name == "cold":
                shutil.rmtree(caches, ignore_errors=True)
                environment["NUMBA_CACHE_DIR"] = str(caches)
            command = [*_SWEEP, "run", job, "--out", str(out), "--set", "P=7:9", "--block", "1"]
            command += ["--no-figures", "--cluster", "serial"]
            times.append(watched(command, out / "store.zarr", environment).first)
        first = statistics.median(times)
        rows.append(Row(f"first point stored, kernels {name}", first, "s", limit, False))
    looked = str(folder / "first-warm-0")
    for words, limit in ((["--help"], 0.6), (["status", looked], 1.0)):
        times = []
        for _ in range(repeats):
            began = time.perf_counter()
            subprocess.run([*_SWEEP, *words], stdout=subprocess.DEVNULL, check=True)
            times.append(time.perf_counter() - began)
        rows.append(Row(f"`{words[0]}`", statistics.median(times), "s", limit, False))
    return rows


@contextmanager
def scratch(parent: Path | None) -> Iterator[Path]:
    """Give a folder that is removed in the end."""
    import tempfile

    folder = Path(tempfile.mkdtemp(prefix="chimera-bench-", dir=parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
