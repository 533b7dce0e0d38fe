"""``run``: plan a sweep or continue it, compute what is missing, reduce."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.cli.arguments import EXECUTOR, STORE, add, add_slurm, errors_in_one_line
from chimera_hpc.cli.ending import end, interrupted
from chimera_hpc.cli.estimate import (
    estimate,
    memory_warnings,
    refuse_absurd,
    refuse_small_memory,
)
from chimera_hpc.cli.jobs import executor_of, load_job, start_early, sweep_folder
from chimera_hpc.cli.reporting import LiveReport, load_reduction
from chimera_hpc.cli.resubmitting import go_on
from chimera_hpc.job import Sweep
from chimera_hpc.run.driver import Driver
from chimera_hpc.run.signals import stop_request

if TYPE_CHECKING:
    from chimera_hpc.run.choice import ExecutorChoice
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep run jobs/quickstart.toml
  python -m chimera_hpc.sweep run jobs/quickstart.toml --workers 4 --out /scratch/me/quick
  python -m chimera_hpc.sweep run jobs/quickstart.toml --set P=10:14 --set seeds=100 --out more
  python -m chimera_hpc.sweep run results/quickstart                       its store holds the job

The same command continues where the sweep stopped, whatever stopped it. Points that ran out of time
or memory are tried run.attempts times in all; `retry` tries failed points once more.
"""


def add_arguments(parser: ArgumentParser) -> None:
    add(parser, "job", "--set", "--out", *EXECUTOR)
    add_slurm(parser)
    add(parser, "--resubmit", "--block", "--no-figures", "--strict", "--yes")


def execute(args: Namespace) -> int:
    with stop_request() as stop:
        try:
            start_early(args)
            sweep = load_job(args.job, args.overrides, args.block)
            folder = sweep_folder(args.out, sweep, args.job)
            executor = executor_of(args, sweep, folder / STORE)
            if args.cluster in ("local", "slurm"):
                refuse_small_memory(sweep, args.mem)
            store = open_or_plan(folder, sweep, args.yes)
            _warn_of_memory(store, executor, args.mem)
            from chimera_hpc.run.messages import RetryPolicy

            retry = RetryPolicy(attempts=sweep.run.attempts)
            driver = Driver(store, executor, stop, folder / "run.log", retry, args.strict)
            driver.program = args.program
            driver.meanwhile = load_reduction
            if not args.no_figures:
                driver.report = LiveReport(folder, store.n_points)
            driver.work()
            return go_on(end(driver, folder, args), driver, args.resubmit)
        except BaseException:
            if not stop.broke_off:
                raise
            return interrupted(stop, args)


def _warn_of_memory(store: Store, executor: ExecutorChoice, size: str | None) -> None:
    """Say if workers may not have the memory that they take."""
    if executor.kind == "local" or (executor.kind == "slurm" and size is not None):
        sizes = (store.n_points, store.block_size, executor.n_workers)
        for line in memory_warnings(store.sweep, *sizes, size):
            print(line, file=sys.stderr)


def check_drawing(sweep: Sweep) -> None:
    """Raise BadInput if a user's model or network is another one in another process."""
    if sweep.has_own_code:
        from chimera_hpc.run.second_draw import check_in_second_process

        check_in_second_process(sweep)


def open_or_plan(folder: Path, sweep: Sweep, yes: bool) -> Store:
    """Return the store in ``folder`` for this sweep: a new one, or the one to continue."""
    path = folder / STORE
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"{folder}: not a folder")
    with errors_in_one_line(folder):
        exists = path.exists()
        if not exists:
            refuse_absurd(sweep, estimate(sweep), folder, yes)
            check_drawing(sweep)
        from chimera_hpc.store.store import Store

        if exists:
            return Store.open(path).adopt(sweep)
        folder.mkdir(parents=True, exist_ok=True)
        try:
            return Store.plan(path, sweep)
        except BadInput:
            if not path.exists():
                raise
            # Another driver planned it in this very moment.
            return Store.open(path).adopt(sweep)
