"""What large sweeps cost: bookkeeping, with points that cost nothing, and large points.

``scripts/scale`` prints the table; it takes less than 20 minutes and about 4 GB of disk.
"""

from __future__ import annotations

import argparse
import compileall
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

sys.path.insert(0, str(Path(__file__).parent))
import large
from measured import MB, Done, Line, peak_memory, run, table

__all__ = ["Done", "Line", "peak_memory", "run", "table"]

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

FOLDER = Path(__file__).parent
JOB = """
name = "scale"
model = "topological_fhn"
[grid]
P = "2:11"
Q = "P"
epsilon = {{ linspace = [0.01, 0.1, {values}] }}
seeds = 1000
[keep]
series = "none"
[run]
block = 300
"""
SMALL, LARGE = 100_000, 1_000_000


def main() -> int:
    """Measure, print the table; 1 when a limit is not held."""
    parser = argparse.ArgumentParser(prog="scripts/scale", description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, help="where to work (default: a temporary folder)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the table here too")
    parser.add_argument("--only", choices=("bookkeeping", "large"), help="one half of the table")
    parser.add_argument("--tiny", action="store_true", help="smallest large points: only to try it")
    parser.add_argument("--points", type=int, default=LARGE, help="points of the large sweep")
    args = parser.parse_args()
    # As an installation does it: the first command would pay for it, or each where none may write.
    compileall.compile_dir(FOLDER.parents[1] / "chimera_hpc", quiet=1)
    folder = Path(tempfile.mkdtemp(prefix="chimera-scale-", dir=args.folder))
    try:
        lines = [] if args.only == "large" else measure(folder, args.points)
        lines += [] if args.only == "bookkeeping" else measure_large(folder, args.tiny)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(table(lines))
    if args.json:
        args.json.write_text(json.dumps([line.words() for line in lines]))
    return 0 if all(line.good for line in lines) else 1


def measure(folder: Path, n_points: int) -> list[Line]:
    """Return all lines of the table."""
    small, big = plan(folder, "small", SMALL), plan(folder, "large", n_points)
    lines = [
        Line(f"plan of {n_points:.0e} points: time", big.seconds, "s", 15),
        Line(f"plan of {n_points:.0e} points: memory", big.memory / MB, "MB", 1000),
    ]
    lines.append(
        Line("blocks of 300 points, one writer", serial_rate(folder), "per second", 50, True)
    )
    memory = [scheduler_memory(folder, store.path) for store in (small, big)]
    growth = (memory[1] - memory[0]) / MB
    what = f"growth of the scheduler's memory, {SMALL:.0e} to {n_points:.0e} points"
    lines.append(Line(what, growth, "MB", 50))
    n_files = sum(len(files) for _, _, files in os.walk(big.path))
    blocks = -(-n_points // 300)
    lines.append(Line(f"files of {blocks} blocks", n_files, "files", 5 * blocks + 200))
    done = run("-m", "chimera_hpc.sweep", "status", big.path.parent, "--json")
    state = json.loads(done.text)
    assert state["done"] == n_points, state
    lines.append(Line(f"status of {n_points:.0e} points: time", done.seconds, "s", 1))
    lines.append(Line(f"status of {n_points:.0e} points: memory", done.memory / MB, "MB", 1000))
    lines += sweep_of_series(folder)
    lines += [tree_time(100_000), sampled_tree(50_000)]
    return lines


def sweep_of_series(folder: Path, n_seeds: int = 54) -> list[Line]:
    """Return the memory of an export and of a selection of a sweep with much series."""
    exported = export_memory(folder, n_seeds)
    store = series_store(folder / "lazy", n_seeds)
    selected = large.lazily(store)
    shutil.rmtree(store.path)
    return [exported, selected]


def measure_large(folder: Path, tiny: bool = False) -> list[Line]:
    """Return the lines about large points and very many of them."""
    return [
        *large.rings(folder, 2_000 if tiny else 100_000, 2 if tiny else 6),
        *large.long_window(folder, 80.0 if tiny else 5_050.0),
        *large.projections(folder, 1_000 if tiny else 100_000),
        *large.many_points(folder, 40_000 if tiny else 10_000_000),
        *large.estimates(folder, ("P=12",) if tiny else ("P=10:15",)),
        large.fair_share(),
        large.first_round(folder, 500 if tiny else 10_000),
    ]


def plan(folder: Path, name: str, n_points: int) -> Done:
    """Plan the store of a sweep, as `run` does before it begins."""
    job, path = folder / f"{name}.toml", folder / name / "store.zarr"
    job.write_text(JOB.format(values=n_points // 10_000))
    program = "from sys import argv; from chimera_hpc.job import Sweep; "
    program += "from chimera_hpc.store.store import Store; Store.plan(argv[2], Sweep.load(argv[1]))"
    done = run("-c", program, job, path)
    return Done(done.seconds, done.memory, done.text, path)


def serial_rate(folder: Path) -> float:
    """Return how many blocks one process writes in a second."""
    sys.path.insert(0, str(FOLDER))
    import nothing  # noqa: F401

    from chimera_hpc.run.messages import RunMessage
    from chimera_hpc.run.work import do_block
    from chimera_hpc.store.store import Store

    path = plan(folder, "serial", SMALL).path
    message, n_blocks = RunMessage(path, 1), Store.open(path).n_blocks
    began = time.perf_counter()
    receipts = [do_block(message, block) for block in range(n_blocks)]
    seconds = time.perf_counter() - began
    assert sum(receipt.n_done for receipt in receipts) == SMALL
    shutil.rmtree(path)
    return n_blocks / seconds


def export_memory(folder: Path, n_seeds: int = 54) -> Line:
    """Return the memory of an export with series; points are 0.5 MB each."""
    store = series_store(folder / "series", n_seeds)
    megabytes = store.n_points * store.sweep.n_samples * store.sweep.n_nodes * 2 / MB
    words = ("export", store.path.parent, "--series", "--to", folder / "series.nc")
    done = run("-m", "chimera_hpc.sweep", *words)
    shutil.rmtree(store.path)
    return Line(f"export of {megabytes:.0f} MB of series: memory", done.memory / MB, "MB", 500)


def tree_time(n_runs: int) -> Line:
    """Return the time of the reduction's tree of all runs, with triplets drawn at random."""
    program = "import sys, numpy; from chimera_hpc.classify.classification import classify; "
    program += "n = int(sys.argv[1]); draw = numpy.random.default_rng(0); "
    program += "made = classify(draw.random((n, 3)), numpy.ones(n)); assert not made.sampled"
    return Line(f"tree of {n_runs:.0e} runs: time", run("-c", program, n_runs).seconds, "s", 200)


def sampled_tree(n_runs: int) -> Line:
    """Return the share of runs whose class by a tree of half of them is that by the tree of all.

    Three groups that overlap, of different sizes; each class of the half counts as the class of
    all with which it shares most.
    """
    program = "import sys, numpy; from chimera_hpc.classify.classification import classify; "
    program += "n = int(sys.argv[1]); draw = numpy.random.default_rng(0); k = draw.choice(3, n, "
    program += "p=[.5, .3, .2]); x = .3 * k[:, None] + draw.normal(0, .07, (n, 3)); "
    program += "one = numpy.ones(n); made = classify(x, one, largest_tree=n // 2); "
    program += "full = classify(x, one); assert made.sampled and not full.sampled; "
    program += "shared = numpy.zeros((4, 4)); "
    program += "numpy.add.at(shared, (made.base.labels, full.base.labels), 1); "
    program += "print(shared.max(1).sum() / n)"
    share = float(run("-c", program, n_runs).text)
    what = f"same classes by a tree of half of {n_runs:.0e} runs"
    return Line(what, share, "", 0.95, True)


def series_store(folder: Path, n_seeds: int) -> Store:
    """Return a store of 20 points per seed with series, none of which was computed."""
    sys.path.insert(0, str(FOLDER))
    import nothing

    from chimera_hpc.job import Sweep
    from chimera_hpc.store.store import Store

    text = JOB.format(values=2).replace("seeds = 1000", f"seeds = {n_seeds}")
    text = text.replace('series = "none"', 'series = "all"').replace("block = 300", "block = 60")
    store = Store.plan(folder / "store.zarr", Sweep.from_toml_text(text))
    for block in range(store.n_blocks):
        first, last = store.block(block)
        result = nothing.nothing(store.sweep, store.points[first:last])
        store.write_block(block, result, 1, 1)
    return store


def scheduler_memory(folder: Path, path: Path) -> int:
    """Do a whole sweep over a scheduler of its own; return the bytes that it occupies then."""
    from distributed import Client

    from chimera_hpc.run.executors import run_dask
    from chimera_hpc.run.messages import RunMessage
    from chimera_hpc.store.store import Store

    store = Store.open(path)
    done = []
    with _dask(folder) as (scheduler, address), Client(address) as client:
        blocks = range(store.n_blocks)
        never: Callable[[], bool] = lambda: False  # noqa: E731
        run_dask(client, RunMessage(path, 1), blocks, lambda r: done.append(r.n_done), never)
        memory: int = psutil.Process(scheduler.pid).memory_info().rss
    assert sum(done) == store.n_points
    return memory


@contextmanager
def _dask(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Run a scheduler and two workers, each a process of its own."""
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    log = (folder / "dask.txt").open("ab")
    processes: list[subprocess.Popen[bytes]] = []

    def start(*words: str) -> None:
        command = [sys.executable, "-m", *words, "--no-dashboard", "--scheduler-file", str(file)]
        processes.append(subprocess.Popen(command, stdout=log, stderr=log))

    try:
        start("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        while not file.exists():
            time.sleep(0.05)
        preload = ("--preload", str(FOLDER / "nothing.py"), "--local-directory", str(folder))
        for _ in range(2):
            start("distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny", *preload)
        yield processes[0], json.loads(file.read_text())["address"]
    finally:
        for process in processes:
            process.kill()
            process.wait()
        log.close()


if __name__ == "__main__":
    sys.exit(main())
