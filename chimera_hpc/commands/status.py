"""``status``: what is done, from the store alone."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.claims import live_claims
from chimera_hpc.commands.arguments import add_folder, store_path
from chimera_hpc.commands.estimate import in_time
from chimera_hpc.commands.exits import Exit
from chimera_hpc.ledger import LedgerScan, ledger_shape, read_metadata, scan_ledger
from chimera_hpc.status import Status

NAME = "status"
HELP = "say what is done, from the store alone, while a sweep runs or after"
EPILOG = """examples:
  python -m chimera_hpc.sweep status results/quickstart
  python -m chimera_hpc.sweep status results/quickstart --json
  python -m chimera_hpc.sweep status results/quickstart --failures
"""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_folder(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--failures", action="store_true", help="list every failed point too")


def execute(args: Namespace) -> int:
    """Print the state of the sweep."""
    path = store_path(args.folder)
    metadata = read_metadata(path)
    scan = scan_ledger(path, metadata)
    state = state_of(path, metadata, scan)
    if args.json:
        print(json.dumps(state))
    else:
        _print(state)
    if args.failures and not args.json:
        _print_failures(path, args.folder)
    return Exit.FAILURES if state["failed"] else Exit.COMPLETE


def state_of(path: Path, metadata: Mapping[str, Any], scan: LedgerScan) -> dict[str, Any]:
    """Return what `status --json` prints."""
    n_points, _ = ledger_shape(metadata)
    codes = scan.columns["status"]
    numbers = np.bincount(np.clip(codes, 0, None), minlength=max(Status) + 1)
    counts = {code: int(numbers[code]) for code in Status}
    finished = (codes >= Status.DONE) & (codes <= Status.NO_WINDOW)
    mean = scan.columns["elapsed_us"][finished].mean() / 1e6 if finished.any() else None
    return {
        "sweep": metadata["attributes"]["spec"].get("name", "?"),
        "points": n_points,
        "statuses": {code.name.lower(): n for code, n in counts.items() if n},
        "done": int(np.count_nonzero(finished)),
        "failed": sum(n for code, n in counts.items() if code.is_failure),
        "pending": counts[Status.NEVER],
        "blocks": len(scan.written),
        "blocks_written": int(np.count_nonzero(scan.written)),
        "blocks_running": len(live_claims(path)),
        "blocks_damaged": len(scan.damaged),
        "seconds_a_point": mean,
        "core_seconds_left": None if mean is None else mean * counts[Status.NEVER],
    }


def _print(state: Mapping[str, Any]) -> None:
    share = 100 * state["done"] / max(1, state["points"])
    print(f"{state['sweep']}: {state['done']} of {state['points']} points done ({share:.1f} %)")
    for code in Status:
        count = state["statuses"].get(code.name.lower())
        if count:
            print(f"  {count:>9}  {code.sentence}")
    print(
        f"  blocks: {state['blocks_written']} of {state['blocks']} written, "
        f"{state['blocks_running']} running, {state['blocks_damaged']} damaged"
    )
    left = state["core_seconds_left"]
    if left:
        print(
            f"  about {in_time(left)} of one core to go, {state['seconds_a_point']:.3g} s a point"
        )


def _print_failures(path: Path, folder: Path) -> None:
    from chimera_hpc.commands.ending import failures
    from chimera_hpc.store import Store

    store = Store.open(path)
    for line in failures(store, folder, most=store.n_points):
        print(line)
