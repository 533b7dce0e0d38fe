"""Large rings, long windows and many points: memory and time of the commands that read them."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from measured import MB, Done, Line, run

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

RING = """
name = "rings"
model = "topological_fhn"
[grid]
P = {points}
Q = "P"
seeds = 1
[fixed]
n_nodes = {nodes}
[integrator]
t_end = 22.0
t_step = 0.02
[features]
start = 2.0
n_peaks = 3
n_overlap = 1
[run]
block = 1
"""
LONG = """
name = "long"
model = "topological_fhn"
[grid]
P = 3
Q = "P"
seeds = 6
[integrator]
t_end = {end}
[features]
start = 50.0
"""
ROUNDS = """
name = "rounds"
model = "topological_fhn"
[grid]
P = "2:11"
Q = "P"
epsilon = {{ linspace = [0.01, 0.1, {values}] }}
[keep]
series = "none"
[decide]
most = 20
refine = {{ epsilon = 0.0002 }}
"""
SWEEP = ("-m", "chimera_hpc.sweep")


def rings(folder: Path, nodes: int, points: int) -> list[Line]:
    """Run, reduce, report, show and export large rings."""
    from chimera_hpc.cli.estimate import estimate
    from chimera_hpc.job import Sweep

    job = folder / "rings.toml"
    job.write_text(RING.format(nodes=nodes, points=json.dumps(list(range(2, 2 + points)))))
    out = folder / "rings"
    planned = estimate(Sweep.load(job)).worker_bytes
    done = run(*SWEEP, "run", job, "--out", out, "--cluster", "serial", "--no-figures", good=(0, 1))
    first = first_estimate((out / "run.log").read_text().splitlines())
    samples = nodes * 1001
    what = f"{points} points of {nodes} nodes"
    lines = [
        Line(f"run of {what}: memory over that of plan", done.memory / planned, "", 1.3),
        Line("a worker's bytes per sample and node", (done.memory - 2e8) / samples, "bytes", 45),
        Line("first ETA of this run over the seconds that it took", first, "", 2, before="7"),
    ]
    shown = run(*SWEEP, "show", out, "P=2", "seed=0").memory
    ran: list[Done] = []
    spent = seconds_of(lambda: ran.append(run(*SWEEP, "reduce", out, good=(0, 1))))
    lines += [
        _memory(f"reduce and report of {what}", ran[0], 1000, "7300 MB"),
        Line("the same: time", ran[0].seconds, "s", 20, before="75 s"),
        Line("the same: processor time, that of other work left out", spent, "s", 20),
        Line("show of one of them: memory over that of plan", shown / planned, "", 1.3),
    ]
    for name, words in (("x.nc", ("--series",)), ("x.csv", ())):
        done = run(*SWEEP, "export", out, *words, "--to", folder / name)
        lines.append(_memory(f"export of them to .{name[2:]}", done, 500, "7800 MB"))
    return [*lines, *_parts(out), _whole(out)]


def first_estimate(log: list[str]) -> float:
    """Return the first ETA of a run over the time that passed from it to the last line with one."""
    lines = [line for line in log if ", ETA " in line]
    first, last = (datetime.fromisoformat(line.split()[0]) for line in (lines[0], lines[-1]))
    hours, minutes, seconds = map(int, lines[0].rsplit(" ", 1)[1].split(":"))
    estimate = 3600 * hours + 60 * minutes + seconds
    return estimate / max((last - first).total_seconds(), 1.0)


def _whole(out: Path) -> Line:
    """Return the time of decoding a whole large point, over that of the same data in one chunk."""
    import zarr

    stored: Any = zarr.open_array(out / "store.zarr", path="u", mode="r")
    kept = stored[:1]
    one: Any = zarr.create_array(
        out / "one-chunk.zarr", data=kept, chunks=kept.shape, compressors=stored.compressors
    )
    seconds = [seconds_here(lambda a=array: a[:1]) for array in (stored, one)]
    what = "processor time to decode a large point over that of one chunk"
    return Line(what, seconds[0] / seconds[1], "", 2)


def _parts(out: Path) -> list[Line]:
    """Bytes of a point's file that a Zarr reader needs for one node and for a stretch of time."""
    import zarr

    from chimera_hpc.store.store import Store

    store = Store.open(out / "store.zarr")

    class Counting(zarr.storage.LocalStore):
        read = 0

        async def get(self, key: str, *words: Any, **options: Any) -> Any:
            data = await super().get(key, *words, **options)
            Counting.read += len(data) if "/c." in key and data is not None else 0
            return data

    array: Any = zarr.open_array(Counting(store.path, read_only=True), path="u", mode="r")
    size = store.files.file("u", 0).stat().st_size
    lines = []
    for what, times, nodes in (
        ("one node", slice(None), slice(7, 8)),
        ("a tenth of the time", slice(0, 100), slice(None)),
    ):
        Counting.read = 0
        assert array[0, times, nodes].size
        lines.append(
            Line(f"share of a large point read for {what}", Counting.read / size, "", 0.25)
        )
    return lines


def long_window(folder: Path, end: float) -> list[Line]:
    """Return the memory of pictures of long series: one run, and six side by side."""
    (folder / "long.toml").write_text(LONG.format(end=end))
    out = folder / "long"
    run(*SWEEP, "run", folder / "long.toml", "--out", out, "--cluster", "serial", "--no-figures")
    what = f"show of {end - 50:g} time units"
    return [
        _memory(what, run(*SWEEP, "show", out, "P=3", "seed=0"), 1000, "3400 MB"),
        _memory(f"{what}, six seeds", run(*SWEEP, "show", out, "P=3"), 1000),
    ]


def first_round(folder: Path, n_points: int) -> Line:
    """Return the processor time that a new process takes to decide and to extend a first round."""
    from nothing import nothing

    from chimera_hpc.job import Sweep
    from chimera_hpc.store.schema import scalar_labels
    from chimera_hpc.store.store import Store

    sweep = Sweep.from_toml_text(ROUNDS.format(values=n_points // 50))
    store, draw = Store.plan(folder / "rounds" / "store.zarr", sweep), np.random.default_rng(0)
    places = [scalar_labels(sweep).index(name) for name in ("V_theta", "V_a", "V_Omega")]
    centres = np.array([(0.05, 0.01, 0.001), (0.3, 0.1, 0.11), (0.55, 0.02, 0.01)])
    for block in range(store.n_blocks):
        points = store.block_points(block)
        share = 1 / (1 + np.exp((0.05 - points.columns["epsilon"]) / 0.01))
        classes = (draw.random((2, len(points))) < [share, share**4]).sum(axis=0)
        result = nothing(sweep, points)
        result.scalars[:, places] = centres[classes] * draw.normal(1.0, 0.2, (len(points), 3))
        store.write_block(block, result, 1, 1)
    program = "import sys, time; from chimera_hpc.store.store import Store; "
    program += "from chimera_hpc.run.rounds import next_round; store = Store.open(sys.argv[1]); "
    program += "began = time.process_time(); assert next_round(store).pending(); "
    program += "print(time.process_time() - began)"
    seconds = float(run("-c", program, store.path).text)
    return Line(f"a first round of {n_points:.0e} points: processor time", seconds, "s", 2)


def lazily(store: Store) -> Line:
    """Return the memory of a selection from a store with much series."""
    program = "import sys, chimera_hpc; data = chimera_hpc.open(sys.argv[1]); "
    program += "made = data.where(data.P == 3, drop=True); made.V_theta.load()"
    return _memory("where(..., drop=True)", run("-c", program, store.path), 500)


def projections(folder: Path, n_runs: int) -> list[Line]:
    """Return the time and the size of the projections of many runs."""
    program = "import sys, numpy; from chimera_hpc.plot.projections import projections; "
    program += "n = int(sys.argv[1]); draw = numpy.random.default_rng(0); x = draw.random((n, 3)); "
    program += "made = projections(x, draw.integers(0, 3, n), ['A', 'B', 'C']); "
    program += "made.savefig(sys.argv[2])"
    target = folder / "projections.pdf"
    done = run("-c", program, n_runs, target)
    size = target.stat().st_size / MB
    what = f"projections of {n_runs:.0e} runs"
    return [_memory(what, done, 1000), Line(f"{what}: file", size, "MB", 3)]


def many_points(folder: Path, n_points: int) -> list[Line]:
    """Return the memory of plan, status and a block where there are very many points."""
    path = folder / "many" / "store.zarr"
    settings = ["P=10:19", "Q=0:9", f"seeds={n_points // 100}", "keep.series=none"]
    settings += ["run.block=4000", "integrator.t_end=30", "features.start=5"]
    planning = "import sys; from chimera_hpc.job import Sweep; "
    planning += "from chimera_hpc.store.store import Store; "
    planning += "Store.plan(sys.argv[2], Sweep.load(sys.argv[1], sys.argv[3:]))"
    job = Path(__file__).parents[2] / "jobs" / "quickstart.toml"
    working = "import sys; sys.path.insert(0, sys.argv[2]); import nothing; "
    working += "from pathlib import Path; from chimera_hpc.run.messages import RunMessage; "
    working += (
        "from chimera_hpc.run.work import do_block; do_block(RunMessage(Path(sys.argv[1]), 1), 7)"
    )
    what = f"of {n_points:.0e} points"
    planned = run("-c", planning, job, path, *settings)
    worked = run("-c", working, path, Path(__file__).parent)
    return [
        _memory(f"plan {what}", planned, 2000, "2000 MB"),
        _memory(f"a worker, one block {what}", worked, 300, "1100 MB"),
        _memory(f"status {what}", run(*SWEEP, "status", path, good=(75,)), 2000),
    ]


def estimates(folder: Path, settings: tuple[str, ...] = ("P=10:15",)) -> list[Line]:
    """Return how far the estimates of `plan` and `status` are from the seconds that a run takes."""
    from chimera_hpc.cli.estimate import estimate
    from chimera_hpc.job import Sweep

    job, out = Path(__file__).parents[2] / "jobs" / "quickstart.toml", folder / "estimates"
    words = [word for setting in settings for word in ("--set", setting)]
    command = (*SWEEP, "run", job, "--out", out, "--cluster", "serial", "--no-figures", *words)
    run(*command, "--set", "seeds=10")
    run(*SWEEP, "extend", job, "--out", out, *words, "--set", "seeds=20")
    state = json.loads(run(*SWEEP, "status", out, "--json", good=(75,)).text)
    spent = seconds_of(lambda: run(*command, "--set", "seeds=20"))
    planned = estimate(Sweep.load(job, [*settings, "seeds=10"])).seconds
    return [
        Line("estimate of plan over the seconds of a run", planned / spent, "", 2),
        Line("the same of status", state["core_seconds_left"] / spent, "", 2),
    ]


def seconds_here(work: Callable[[], object]) -> float:
    """Return the seconds of processor that a call takes in this process: the least of three."""
    taken = []
    for _ in range(3):
        began = time.process_time()
        work()
        taken.append(time.process_time() - began)
    return min(taken)


def seconds_of(work: Callable[[], object]) -> float:
    """Return the seconds of processor that the children of a call take."""
    before, began = os.times(), time.perf_counter()
    work()
    after = os.times()
    assert time.perf_counter() > began
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )


def fair_share() -> Line:
    """Return how much of the machine's memory two workers may take together."""
    from chimera_hpc.base.memory import share_of_memory, usable_memory

    share = 2 * share_of_memory(2) / usable_memory()
    return Line("memory of two local workers, of the machine's", share, "", 1, before="1.05")


def _memory(what: str, done: Done, limit: float, before: str = "") -> Line:
    return Line(f"{what}: memory", done.memory / MB, "MB", limit, before=before)
