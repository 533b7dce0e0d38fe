"""``status``: what is done, from the store alone."""

from __future__ import annotations

import json
import os
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.exits import Exit
from chimera_hpc.base.files import time_at
from chimera_hpc.base.status import Status
from chimera_hpc.base.wording import in_time
from chimera_hpc.cli.arguments import add, flag, store_path
from chimera_hpc.cli.cell_map import Cells, draw
from chimera_hpc.cli.deciding import decide_state, state_line
from chimera_hpc.store.claims import live_claims
from chimera_hpc.store.ledger import (
    LedgerScan,
    chunk_name,
    ledger_shape,
    read_metadata,
    scan_ledger,
)
from chimera_hpc.store.runs import block_work

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

EPILOG = """examples:
  python -m chimera_hpc.sweep status results/quickstart
  python -m chimera_hpc.sweep status results/quickstart --json
  python -m chimera_hpc.sweep status results/quickstart --failures

The map has one sign per cell, in colour on a terminal unless NO_COLOR is set. After a reduction,
capital letters are classes (O ordered, C chimera, D disordered, S steady). `watch` repeats this
display. The exit status is 75 while points are pending.
"""
_RECENT_BLOCKS = 64
_PAUSE = 60.0
"""Seconds without a block, beyond what blocks take, after which work is taken to have stopped."""


def add_arguments(parser: ArgumentParser) -> None:
    add(
        parser,
        *("folder", "--json"),
        failures=flag("list every failed point too"),
        no_map=flag("leave out the map of cells"),
    )


def execute(args: Namespace) -> int:
    path = store_path(args.folder)
    metadata = read_metadata(path)
    scan = scan_ledger(path, metadata)
    state = state_of(path, metadata, scan)
    if args.json:
        print(json.dumps(state))
    else:
        print("\n".join(lines_of(state)))
        if not args.no_map:
            _print_map(path, metadata, scan)
    if args.failures and not args.json:
        _print_failures(path, args.folder)
    return Exit.of_points(state["pending"], state["failed"])


def state_of(path: Path, metadata: Mapping[str, Any], scan: LedgerScan) -> dict[str, Any]:
    """Return what `status --json` prints."""
    n_points, block_size = ledger_shape(metadata)
    codes = scan.columns["status"]
    numbers = np.bincount(np.clip(codes, 0, None), minlength=max(Status) + 1)
    counts = {code: int(numbers[code]) for code in Status}
    finished = (codes >= Status.DONE) & (codes <= Status.NO_WINDOW)
    mean = seconds_per_point(path, scan.columns["elapsed_us"][finished])
    running = len(live_claims(path))
    rate = recent_rate(path, scan, block_size) if running else None
    return {
        "sweep": metadata["attributes"]["spec"].get("name", "?"),
        "points": n_points,
        "statuses": {code.name.lower(): n for code, n in counts.items() if n},
        "done": int(np.count_nonzero(finished)),
        "failed": sum(n for code, n in counts.items() if code.is_failure),
        "pending": counts[Status.NEVER],
        "blocks": len(scan.written),
        "blocks_written": int(np.count_nonzero(scan.written)),
        "blocks_running": running,
        "blocks_damaged": len(scan.damaged),
        "seconds_a_point": mean,
        "core_seconds_left": None if mean is None else mean * counts[Status.NEVER],
        "points_a_second": rate,
        "seconds_left": counts[Status.NEVER] / rate if rate else None,
        **({} if (decide := decide_state(path, metadata)) is None else {"decide": decide}),
    }


def seconds_per_point(path: Path, integration_us: NDArray[np.int64]) -> float | None:
    """Return the work of one core per point, by the blocks of all runs; None if unknown.

    For runs that did not record it, such as those of version 0.1, it is the mean of the points'
    own times (``integration_us``), which count the integration only.
    """
    work = block_work(path)
    if work.points > 0:
        return work.seconds / work.points
    return float(integration_us.mean()) / 1e6 if len(integration_us) else None


def recent_rate(path: Path, scan: LedgerScan, block_size: int) -> float | None:
    """Return the points that come in a second, by all who work on a store; None if unknown.

    It is told from the times at which the latest blocks were written, back to the last pause, and
    from how long the first of them took.
    """
    ends = np.array(_written_at(path, np.flatnonzero(scan.written)))
    if not len(ends):
        return None
    work = scan.columns["elapsed_us"] / 1e6
    starts = np.arange(0, len(work), block_size)
    seconds = np.add.reduceat(work, starts)[scan.written]
    tried = np.add.reduceat((scan.columns["status"] != Status.NEVER).astype(np.int64), starts)
    order = np.argsort(ends)[-_RECENT_BLOCKS:]
    ends, seconds, n_points = ends[order], seconds[order], tried[scan.written][order]
    pauses = np.flatnonzero(np.diff(ends) > _PAUSE + 3.0 * seconds[1:])
    recent = slice(int(pauses[-1]) + 1 if len(pauses) else 0, None)
    # The blocks' times are those of the file server's clock.
    now = time_at(path / "ledger")
    span = now - float((ends - seconds)[recent].min())
    if now - ends[-1] < _PAUSE + 3.0 * seconds.max():
        # A block that is under way counts when it ends.
        span = float(ends[-1] - (ends - seconds)[recent].min())
    return float(n_points[recent].sum() / max(span, 1e-3))


def _written_at(path: Path, blocks: np.ndarray[Any, Any]) -> list[float]:
    folder = os.fspath(path / "ledger")
    times = []
    for block in blocks.tolist():
        try:
            times.append(os.stat(os.path.join(folder, chunk_name(block, 2))).st_mtime)
        except OSError:
            times.append(0.0)
    return times


def lines_of(state: Mapping[str, Any]) -> list[str]:
    """Return the state in words."""
    share = 100 * state["done"] / max(1, state["points"])
    lines = [f"{state['sweep']}: {state['done']} of {state['points']} points done ({share:.1f} %)"]
    for code in Status:
        count = state["statuses"].get(code.name.lower())
        if count:
            lines.append(f"  {count:>9}  {code.sentence}")
    lines.append(
        f"  blocks: {state['blocks_written']} of {state['blocks']} written, "
        f"{state['blocks_running']} running, {state['blocks_damaged']} damaged"
    )
    if "decide" in state:
        lines.append(state_line(state["decide"]))
    if state["points_a_second"]:
        rate, left = state["points_a_second"], state["seconds_left"]
        lines.append(f"  {rate:.3g} points per second now, about {in_time(left)} to go")
    elif state["core_seconds_left"]:
        left, mean = state["core_seconds_left"], state["seconds_a_point"]
        lines.append(f"  about {in_time(left)} of one core to go, {mean:.3g} s per point")
    return lines


def map_of(cells: Cells | None, scan: LedgerScan, console: Console, height: int) -> Text | None:
    """Return the map of cells for a console; None where there is none to show."""
    if cells is None or len(cells.cell) != len(scan.columns["status"]):
        return None
    plain = not console.encoding.lower().startswith("utf")
    return draw(cells, scan.columns["status"], console.width, height, plain)


def _print_map(path: Path, metadata: Mapping[str, Any], scan: LedgerScan) -> None:
    cells = Cells.read(path, metadata)
    if cells is None:
        return
    from rich.console import Console

    console = Console(highlight=False)
    found = map_of(cells, scan, console, height=60)
    if found is not None:
        print()
        console.print(found, no_wrap=True, crop=False, overflow="ignore")


def _print_failures(path: Path, folder: Path) -> None:
    from chimera_hpc.cli.ending import failures
    from chimera_hpc.store.store import Store

    store = Store.open(path)
    for line in failures(store, folder, most=store.n_points):
        print(line)
