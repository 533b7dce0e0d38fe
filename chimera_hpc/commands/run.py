"""``run``: plan a sweep or go on with it, compute what is missing, reduce."""

from __future__ import annotations

import shlex
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.commands.arguments import STORE, add_block, add_job, load_job
from chimera_hpc.commands.exits import Exit
from chimera_hpc.commands.stopping import StopRequest, stop_request
from chimera_hpc.errors import BadInput
from chimera_hpc.grid import Sweep
from chimera_hpc.progress import Reporter

if TYPE_CHECKING:
    from chimera_hpc.execute import Again, BlockReceipt
    from chimera_hpc.store import Store

NAME = "run"
HELP = "run a sweep, or go on with one, and reduce it"
EPILOG = """examples:
  python -m chimera_hpc.sweep run jobs/quickstart.toml
  python -m chimera_hpc.sweep run jobs/quickstart.toml --workers 4 --out /scratch/me/quick
  python -m chimera_hpc.sweep run jobs/quickstart.toml --set P=10:14 --set seeds=100 --out more

The same command again goes on where the sweep stopped, however it stopped.
"""

CLUSTERS = ("serial", "local", "scheduler-file")
_WAIT_SECONDS = 1.0


@dataclass(frozen=True)
class Cluster:
    """Where the work is done."""

    kind: str
    workers: int = 0
    scheduler_file: Path | None = None


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_job(parser)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="the sweep's folder (default: results/NAME)"
    )
    parser.add_argument(
        "--cluster",
        default="local",
        choices=CLUSTERS,
        help="serial: this process; local: worker processes here (default); "
        "scheduler-file: a Dask cluster that is running already",
    )
    parser.add_argument(
        "--scheduler-file", type=Path, metavar="FILE", help="file that its scheduler wrote"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="worker processes (default: one a core)"
    )
    add_block(parser)
    parser.add_argument("--no-figures", action="store_true", help="results.json, but no figures")


def execute(args: Namespace) -> int:
    """Run the sweep of a job file."""
    sweep = load_job(args.job, args.overrides, args.block)
    folder = (args.out or Path("results") / sweep.name).absolute()
    cluster = cluster_of(args, sweep)
    store = open_or_plan(folder, sweep)
    from chimera_hpc.execute import Again

    with stop_request() as stop, Reporter(store.n_points, folder / "run.log") as reporter:
        work(store, cluster, stop, reporter, Again())
    return finish(store, folder, stop, make_figures=not args.no_figures)


def cluster_of(args: Namespace, sweep: Sweep) -> Cluster:
    """Return what the arguments say of where the work is done."""
    if args.workers is not None and args.workers < 1:
        raise BadInput(f"--workers {args.workers}: allowed is 1 or more")
    if (args.cluster == "scheduler-file") != (args.scheduler_file is not None):
        raise BadInput("--cluster scheduler-file and --scheduler-file FILE go together")
    return Cluster(args.cluster, args.workers or sweep.run.workers, args.scheduler_file)


def open_or_plan(folder: Path, sweep: Sweep) -> Store:
    """Return the store in ``folder`` for this sweep: a new one, or the one to go on with."""
    from chimera_hpc.store import Store

    path = folder / STORE
    if path.exists():
        return Store.open(path).adopt(sweep)
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder}: not a folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return Store.plan(path, sweep)
    except OSError as error:
        raise BadInput(f"{folder}: can't be written: {error.strerror or error}") from None


def work(
    store: Store, cluster: Cluster, stop: StopRequest, reporter: Reporter, again: Again
) -> None:
    """Do what is left of a store, with the executor asked for, until nothing is left or to stop."""
    from chimera_hpc.execute import stop_file
    from chimera_hpc.provenance import gather

    for line in store.repair():
        reporter.say(line)
    blocks = pending(store, again)
    reporter.begin(store.n_points - points_left(store))
    if not blocks:
        reporter.say(f"nothing to compute: all {store.n_points} points are done")
        return
    run = store.start_run({**gather(), "cluster": cluster.kind})
    reporter.say(
        f"run {run}: {len(blocks)} of {store.n_blocks} blocks to do, {cluster.kind}, in {store.path}"
    )
    from chimera_hpc.task import warm_up

    began = time.perf_counter()
    warm_up(store.sweep, store.points)
    reporter.note(f"kernels ready after {time.perf_counter() - began:.1f} s")
    try:
        _work_through(store, cluster, stop, reporter, again, run)
    finally:
        stop_file(store.path, run).unlink(missing_ok=True)


def _work_through(
    store: Store,
    cluster: Cluster,
    stop: StopRequest,
    reporter: Reporter,
    again: Again,
    run: int,
) -> None:
    from chimera_hpc.cluster import existing_cluster, local_cluster
    from chimera_hpc.execute import run_dask, run_serial

    def note(receipt: BlockReceipt) -> None:
        if receipt.taken:
            return
        reporter.note(
            f"block {receipt.block}: {receipt.n_done} done, {receipt.n_failed} failed, "
            f"{receipt.seconds:.2f} s"
        )
        reporter.add(receipt.n_done, receipt.n_failed)

    if cluster.kind == "serial":
        for blocks in rounds(store, stop, again):
            run_serial(store, blocks, run, note, stop, again)
        return
    chosen = (
        existing_cluster(cluster.scheduler_file)
        if cluster.scheduler_file
        else local_cluster(cluster.workers)
    )
    with chosen as client:
        for blocks in rounds(store, stop, again):
            run_dask(store, client, blocks, run, note, stop, again)


def rounds(store: Store, stop: StopRequest, again: Again) -> Iterator[list[int]]:
    """Yield the blocks that are free, again and again, until nothing is left or to stop.

    Blocks in other hands are waited for: their owner may die.
    """
    from chimera_hpc.claims import live_claims

    while not stop():
        blocks = pending(store, again)
        if not blocks:
            return
        others = live_claims(store.path)
        free = [block for block in blocks if block not in others]
        if free:
            yield free
        else:
            time.sleep(_WAIT_SECONDS)


def pending(store: Store, again: Again) -> list[int]:
    """Return the blocks with something to do."""
    return store.pending(True, attempts=again.attempts, statuses=again.statuses)


def points_left(store: Store) -> int:
    """Return the number of points that never ran."""
    from chimera_hpc.status import Status

    return store.status()[Status.NEVER]


def finish(store: Store, folder: Path, stop: StopRequest, make_figures: bool) -> int:
    """Reduce what there is, say how it went, and return the exit status."""
    from chimera_hpc.status import Status

    counts = store.status()
    if stop() and counts[Status.NEVER]:
        print(f"stopped: {counts[Status.NEVER]} of {store.n_points} points left; to go on:")
        print(f"  {again_command()}")
        return stop.exit_status
    from chimera_hpc.outputs import reduce_sweep

    reduce_sweep(folder, make_figures=make_figures, say=print)
    failed = {code: n for code, n in counts.items() if code.is_failure and n}
    for code, n in failed.items():
        print(f"{n} points failed: {code.sentence}")
    return Exit.FAILURES if failed else Exit.COMPLETE


def again_command() -> str:
    """Return the command that goes on, as it was typed."""
    return shlex.join(["python", "-m", "chimera_hpc.sweep", *sys.argv[1:]])
