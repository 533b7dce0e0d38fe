"""``shard``: compute one share of a sweep's blocks, as an element of a job array does."""

from __future__ import annotations

import os
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.base.status import Status
from chimera_hpc.cli.arguments import add, path_name, store_path, value
from chimera_hpc.cli.jobs import load_job, sweep_folder
from chimera_hpc.cli.resubmitting import go_on
from chimera_hpc.cli.run import open_or_plan
from chimera_hpc.run.choice import ExecutorChoice
from chimera_hpc.run.driver import Driver
from chimera_hpc.run.signals import stop_request
from chimera_hpc.store.ledger import FAILED

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep shard results/quickstart --of 16              in a job array
  python -m chimera_hpc.sweep shard results/quickstart --of 16 --index 3
  python -m chimera_hpc.sweep shard jobs/quickstart.toml --of 16            plans the store, too

Share i of n has the blocks i, i + n, i + 2n, ...; shares are independent, and any of them may be
repeated. In a job array, --index defaults to SLURM_ARRAY_TASK_ID.
"""
_ELEMENT = "SLURM_ARRAY_TASK_ID"


def add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("folder", **value("DIR", path_name, "the sweep's folder, or a job file"))
    add(
        parser,
        *("--set", "--out", "--resubmit"),
        of=value("N", int, "number of shares", required=True),
        index=value("I", int, "which share, from 0"),
    )


def execute(args: Namespace) -> int:
    share = share_of(args.index, args.of)
    with stop_request() as stop:
        try:
            from chimera_hpc.run.messages import RetryPolicy
            from chimera_hpc.store.store import Store

            path = _store_path(args.folder, args.out, args.overrides)
            store = Store.open(path)
            log = path.parent / "slurm" / f"shard-{share[0]}.log"
            log.parent.mkdir(exist_ok=True)
            retry = RetryPolicy(attempts=store.sweep.run.attempts)
            driver = Driver(store, ExecutorChoice("serial", share=share), stop, log, retry)
            driver.program = args.program
            driver.work()
            return go_on(_end(driver), driver, args.resubmit)
        except BaseException:
            if not stop.broke_off:
                raise
            return stop.exit_status


def share_of(index: int | None, of: int) -> tuple[int, int]:
    """Return which share of how many; without an index, the one that the job array tells.

    An element's number is its share, so that any part of an array can be submitted again.
    """
    if index is None:
        element = os.environ.get(_ELEMENT, "")
        if not element.isdecimal():
            raise BadInput("--index: needed outside of a SLURM job array")
        index = int(element)
    if of < 1 or not 0 <= index < of:
        raise BadInput(f"share {index} of {of}: allowed are --of 1 or more and --index 0 to of - 1")
    return index, of


def _store_path(folder: Path, out: Path | None, overrides: list[str]) -> Path:
    """Return the store of a folder, or of a job file, which is planned by the first who comes."""
    if not folder.is_file():
        if overrides:
            raise BadInput(f"--set: {folder} is planned already; it goes with a job file only")
        return store_path(folder.absolute())
    sweep = load_job(folder, overrides)
    place = sweep_folder(out, sweep, folder)
    try:
        return open_or_plan(place, sweep, yes=False).path
    except BadInput:
        # Another element may have planned it in this very moment.
        return open_or_plan(place, sweep, yes=False).path


def _points_left(store: Store, index: int, of: int) -> tuple[int, int]:
    """Return how many points of a share are pending, and how many failed."""
    codes = store.ledger()["status"]
    mine = codes[np.arange(len(codes)) // store.block_size % of == index]
    return int((mine == Status.NEVER).sum()), int(np.isin(mine, FAILED).sum())


def _end(driver: Driver) -> int:
    left = driver.pending()
    index, of = driver.executor.share or (0, 1)
    name = f"share {index} of {of}"
    if driver.ended_by or (driver.stop() and left):
        print(f"{name}: stopped with {len(left)} blocks left: {driver.ended_by or 'as asked'}")
        return Exit.MORE_TO_DO if driver.ended_by else driver.stop.exit_status
    for block, error in driver.broken.items():
        print(f"block {block} could not be done: {error.text} (more in {driver.log})")
    # Someone may have extended the store meanwhile.
    pending, failed = _points_left(driver.store.open(driver.store.path), index, of)
    print(f"{name}: done" + (f", {failed} points failed" if failed else ""))
    if driver.broken:
        return Exit.FAILURES
    if pending:
        print(f"{name}: {pending} points were added meanwhile; the same command computes them")
    return Exit.of_points(pending, failed)
