"""The end of a run: the reduction, what failed and why, the exit status."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chimera_hpc.base.exits import Exit
from chimera_hpc.base.status import Status
from chimera_hpc.cli.reporting import reduce_and_report
from chimera_hpc.run.signals import StopRequest

if TYPE_CHECKING:
    from chimera_hpc.run.driver import Driver
    from chimera_hpc.store.blocks import Damage
    from chimera_hpc.store.store import Store

MOST_LINES = 20
"""Failed points that are listed one by one."""
_REPAIRS = 3
_PATIENCE = 10.0
"""Seconds to wait for a file to show up."""


def end(driver: Driver, folder: Path, args: Namespace) -> int:
    """Reduce what there is, say how it went, and return the exit status."""
    store = driver.store
    left = store.status()[Status.NEVER]
    if driver.ended_by:
        print(f"stopped: {driver.ended_by}", file=sys.stderr)
        return _more_to_do(left, store, args, Exit.MORE_TO_DO)
    if driver.stop():
        return _more_to_do(left, store, args, driver.stop.exit_status)
    damage = _reduce(driver, folder, not args.no_figures)
    if driver.should_stop():
        return end(driver, folder, args)
    # Someone may have extended the store since the run began.
    store = store.open(store.path)
    for line in (*damage, *failures(store, folder)):
        print(line)
    for block, error in driver.broken.items():
        print(f"block {block} could not be done: {error.text} (more in {driver.log})")
    if damage or driver.broken:
        return Exit.FAILURES
    counts = store.status()
    if left := counts[Status.NEVER]:
        print(f"{left} points were added meanwhile; to go on:\n  {again_command(args)}")
    return Exit.of_points(left, sum(n for code, n in counts.items() if code.is_failure))


def interrupted(stop: StopRequest, args: Namespace) -> int:
    """Print how to continue after a signal interrupted the work, and return the exit status."""
    print(f"broken off; to go on:\n  {again_command(args)}")
    return stop.exit_status


def failures(store: Store, folder: Path, most: int = MOST_LINES) -> Iterator[str]:
    """Yield a line for each failed point, and where the rest is found when there are many."""
    ledger = store.ledger()
    codes, steps = ledger["status"], ledger["steps"]
    failed = np.flatnonzero((codes >= min(_FAILURES)) & (codes <= max(_FAILURES)))
    if len(failed):
        yield f"{len(failed)} points failed:"
    for i in failed[:most].tolist():
        yield f"  {name_of(store, i)}: {Status(int(codes[i])).reason(int(steps[i]))}"
    if len(failed) > most:
        yield f"  and {len(failed) - most} more: status --failures {shlex.quote(str(folder))}"


def name_of(store: Store, i: int) -> str:
    """Return what tells a point from the others: ``P=3 Q=5 seed=7``."""
    row = store.points.row(i)
    varying = [n for n, column in store.points.columns.items() if (column != column[0]).any()]
    return " ".join(f"{name}={row[name]}" for name in varying or store.points.axes)


def again_command(args: Namespace) -> str:
    """Return the command that continues the sweep, as it was typed."""
    return shlex.join([sys.executable, "-m", "chimera_hpc.sweep", *args.typed])


def _more_to_do(left: int, store: Store, args: Namespace, status: Exit) -> int:
    what = f"{left} of {store.n_points} points" if left else "the reduction"
    print(f"stopped: {what} left; to go on:\n  {again_command(args)}")
    return status


def _reduce(driver: Driver, folder: Path, make_figures: bool) -> list[str]:
    """Reduce the store; blocks that turn out to be damaged are computed again first.

    Returns what is still damaged.
    """
    from chimera_hpc.store.blocks import DamagedChunk

    found = []
    for _ in range(_REPAIRS):
        try:
            reduce_and_report(folder, make_figures)
        except DamagedChunk as error:
            if _shows_up(driver.store, error.damage):
                continue
            found = [str(error.damage)]
            print(f"damaged, to be computed again: {error.damage}")
            driver.store.discard_block(error.damage.block)
            driver.work()
            if driver.should_stop():
                return []
        else:
            return []
    return found


def _shows_up(store: Store, damage: Damage) -> bool:
    """Whether a chunk that is missing is there after a while.

    Network file systems show late what other machines have written.
    """
    if damage.reason != "missing":
        return False
    left = store.find_damaged(patience=_PATIENCE)
    return all((other.block, other.array) != (damage.block, damage.array) for other in left)


_FAILURES = tuple(code for code in Status if code.is_failure)
