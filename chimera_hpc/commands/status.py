"""``status``: what is done, from the store alone."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from collections import Counter

import numpy as np

from chimera_hpc.commands.arguments import add_folder, store_path
from chimera_hpc.commands.exits import Exit
from chimera_hpc.commands.plan import in_time
from chimera_hpc.claims import live_claims
from chimera_hpc.ledger import ledger_shape, read_metadata, scan_ledger
from chimera_hpc.status import Status

NAME = "status"
HELP = "say what is done, from the store alone, while a sweep runs or after"
EPILOG = """examples:
  python -m chimera_hpc.sweep status results/quickstart
  python -m chimera_hpc.sweep status results/quickstart --json
"""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_folder(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def execute(args: Namespace) -> int:
    """Print the state of the sweep."""
    path = store_path(args.folder)
    metadata = read_metadata(path)
    scan = scan_ledger(path, metadata)
    codes = Counter(Status(code) for code in scan.columns["status"].tolist())
    n_points, block_size = ledger_shape(metadata)
    finished = np.isin(scan.columns["status"], [1, 2, 3])
    mean = scan.columns["elapsed_us"][finished].mean() / 1e6 if finished.any() else None
    state = {
        "sweep": metadata["attributes"]["spec"]["name"],
        "points": n_points,
        "statuses": {code.name.lower(): codes[code] for code in Status if codes[code]},
        "done": int(finished.sum()),
        "failed": sum(count for code, count in codes.items() if code.is_failure),
        "pending": codes[Status.NEVER],
        "blocks": len(scan.written),
        "blocks_written": int(scan.written.sum()),
        "blocks_running": len(live_claims(path)),
        "blocks_damaged": len(scan.damaged),
        "seconds_a_point": mean,
        "core_seconds_left": None if mean is None else mean * codes[Status.NEVER],
    }
    if args.json:
        print(json.dumps(state))
    else:
        _print(state, codes)
    return Exit.FAILURES if state["failed"] else Exit.COMPLETE


def _print(state: dict[str, object], codes: Counter[Status]) -> None:
    share = 100 * int(str(state["done"])) / max(1, int(str(state["points"])))
    print(f"{state['sweep']}: {state['done']} of {state['points']} points done ({share:.1f} %)")
    for code in Status:
        if codes[code]:
            print(f"  {codes[code]:>9}  {code.sentence}")
    print(
        f"  blocks: {state['blocks_written']} of {state['blocks']} written, "
        f"{state['blocks_running']} running, {state['blocks_damaged']} damaged"
    )
    left = state["core_seconds_left"]
    if isinstance(left, float) and left > 0:
        print(f"  about {in_time(left)} of one core to go, {state['seconds_a_point']:.3g} s a point")
