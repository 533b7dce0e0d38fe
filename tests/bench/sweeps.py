"""Whole commands: workers, overhead, memory, first point, the light commands, the plane."""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bare
import psutil
from programs import SCALE, load_program
from single import Row, Scaling
from turns import Program, take_turns

ROOT = Path(__file__).parents[2]
PLANE = ROOT / "jobs" / "paper" / "plane.toml"
MB = 1e6
_SWEEP = (sys.executable, "-P", "-m", "chimera_hpc.sweep")
_TURN = 0.1
"""Seconds that bare processes run before it is others' turn: a virtual machine may change its speed
within a second."""
_WHOLE_TURN = 1.0
"""The same where a whole command is measured: what Dask's processes do by the clock is late when
they are woken, which costs some milliseconds a turn that no run has."""


@dataclass(frozen=True)
class Watched:
    """A command that has ended."""

    seconds: float
    peak: float
    """Most memory that a process of it held, bytes."""
    first: float
    """Seconds until the first finished point; NaN where none was waited for."""


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


def workers(
    folder: Path,
    settings: list[str],
    seeds: tuple[int, ...],
    pieces: int,
    repeats: dict[int, int],
    scaling: Scaling,
) -> list[Row]:
    """The plane with one worker and with two, and its blocks without executor and store.

    `repeats` says how often a whole command of so many workers and its bare blocks are compared.
    """
    options = [word for setting in settings for word in ("--set", setting)]
    run = [*_SWEEP, "run", str(PLANE), *options]
    # The first run is not measured: it may have to compile the kernels.
    for k, n in enumerate((seeds[0], *seeds)):
        out = folder / f"plane-seeds-{n}-{k}"
        command = [*run, "--set", f"seeds={n}", "--out", str(out), "--workers", "2", "--no-figures"]
        seconds = watched(command).seconds
        if k > 0:
            scaling.points.append((_points(out), seconds))
    blocks = [str(PLANE), *settings]
    compared = {
        n: [_beside_bare(run, blocks, folder, n, k) for k in range(times)]
        for n, times in repeats.items()
    }
    cost = {n: statistics.median(over for _, over in each) for n, each in compared.items()}
    seconds = statistics.median(whole for whole, _ in compared[2])
    rows = _two_processes(folder, blocks, pieces, cost)
    gain = rows[0].value
    full = watched([*run, "--out", str(folder / "plane"), "--workers", "2"])
    size = _points(folder / "plane")
    # As if both had met the machine that the one with two workers met.
    scaling.workers = [(1, gain * seconds), (2, seconds)]
    scaling.points.append((size, seconds))
    note = ""
    for n, each in compared.items():
        note += f"{n} worker{'s' * (n > 1)}: {', '.join(f'{over:.1%}' for _, over in each)}; "
    note += f"{seconds:.1f} s with two; start, planning, reduction included"
    return [
        *rows,
        Row("whole command over bare blocks, minus one", max(cost.values()), "", 0.05, False, note),
        Row("largest worker process", full.peak / MB, "MB", 320.0, False),
        Row(f"the {size}-point plane, 2 workers, figures included", full.seconds / 60, "minutes",
            6.0, False),
    ]  # fmt: skip


def _two_processes(
    folder: Path, blocks: list[str], pieces: int, cost: dict[int, float]
) -> list[Row]:
    """What a second worker gains, and what the machine's second core gives."""
    pairs = {}
    # What lasts longer gets longer turns, so that all end at about the same time. Only those that
    # have taken turns are compared, for the machine changes.
    for kind, words, share in (("blocks", blocks, 1.0), ("dgemm", [str(pieces)], 0.5)):
        pairs[kind] = [bare.program(kind, n, words, folder) for n in (1, 2)]
        pairs[kind][0].share, pairs[kind][1].share = 2.0 * share, share
    take_turns([program for pair in pairs.values() for program in pair], _TURN)
    limit, given = (one.seconds / two.seconds for one, two in pairs.values())
    gain = limit * (1.0 + cost[1]) / (1.0 + cost[2])
    one, two = (program.seconds for program in pairs["blocks"])
    note = f"{limit:.2f} times without executor and store ({one:.1f} s and {two:.1f} s); with "
    note += "them, see the overhead below"
    machine = f"dgemm in two processes over one: {given:.2f} times, by turns with the bare blocks"
    return [
        Row("2 workers over 1, whole command", gain, "times", 1.9, True, note),
        Row("the same, of what two cores of this machine give", gain / given, "", 0.95, True,
            machine),
    ]  # fmt: skip


def _beside_bare(
    run: list[str], blocks: list[str], folder: Path, n: int, k: int
) -> tuple[float, float]:
    """Seconds of the `k`-th command with so many workers; its time over bare blocks minus one."""
    out = ["--out", str(folder / f"plane-{n}-{k}"), "--workers", str(n), "--no-figures"]
    whole, alone = Program([[*run, *out]]), bare.program("blocks", n, blocks, folder)
    take_turns([whole, alone], _WHOLE_TURN)
    return whole.seconds, whole.seconds / alone.seconds - 1.0


def _points(out: Path) -> int:
    total: int = json.loads((out / "results.json").read_text())["points"]["total"]
    return total


def memory(folder: Path, t_ends: tuple[float, float]) -> list[Row]:
    """Growth of a process that integrates ten times as long."""
    peak_memory = load_program(SCALE, "scale_measurements").peak_memory
    peaks = []
    for t_end in t_ends:
        settings = ["P=12", "seeds=8", f"integrator.t_end={t_end}", f"features.start={t_end - 50}"]
        words = [str(ROOT / "jobs" / "quickstart.toml"), *settings]
        command = bare.command("blocks", words, folder)
        none = subprocess.DEVNULL
        process = subprocess.Popen(command, stdin=none, stdout=none)
        peak = 0
        while process.poll() is None:
            peak = max(peak, peak_memory(process.pid))
            time.sleep(0.02)
        peaks.append(peak / MB)
    note = f"{peaks[0]:.0f} MB and {peaks[1]:.0f} MB; the analysis interval is 50 in both"
    what = f"growth of a worker from t_end {t_ends[0]:g} to {t_ends[1]:g}"
    return [Row(what, peaks[1] - peaks[0], "MB", 20.0, False, note)]


def starting(folder: Path, repeats: int, cold: bool = True) -> list[Row]:
    """First finished point with warm and with cold kernels; commands that only look.

    Without `cold` nothing is compiled: for the tests.
    """
    job = str(ROOT / "jobs" / "quickstart.toml")
    rows = []
    for name, limit in (("warm", 5.0), ("cold", 40.0)):
        times = []
        for k in range(repeats if name == "warm" else 1):
            out, caches = folder / f"first-{name}-{k}", folder / "caches"
            environment = dict(os.environ)
            if name == "cold" and cold:
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
    folder = Path(tempfile.mkdtemp(prefix="chimera-bench-", dir=parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
