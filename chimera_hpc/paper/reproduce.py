"""``scripts/reproduce``: run every job of the paper, judge its claims, write the scoreboard."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from chimera_hpc.errors import BadInput
from chimera_hpc.files import write_atomically
from chimera_hpc.paper.claims import markdown, read_claims, scoreboard, summary
from chimera_hpc.paper.evidence import Evidence
from chimera_hpc.paper.plan import JOBS, QUICK

_ROOT = Path(__file__).resolve().parents[2]
_ATLASES = ("diagonal", "orientation2")

Say = Callable[[str], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    args = _parse(arguments)
    began = time.monotonic()
    try:
        names = _chosen(args.only)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    folder: Path = args.out.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    times = run_jobs(names, folder, args.quick, args.workers, print)
    failed = [name for name, (status, _) in times.items() if status]
    audit: dict[str, Any] = {}
    if not args.no_audit and not failed and names:
        from chimera_hpc.paper.audit import audit_jobs

        audit = audit_jobs(folder, names, args.share, args.workers, print)
    rows = scoreboard(read_claims(args.jobs / "claims.toml"), Evidence(folder))
    seconds = time.monotonic() - began
    write_scoreboard(folder, rows, audit, {n: t for n, (_, t) in times.items()}, args.quick)
    print(summary(rows))
    for row in rows:
        if row["reproduced"] is False:
            print(f"  not reproduced: {row['id']}: {row['measured']}")
    print(f"scoreboard  {folder / 'claims.md'}, {folder / 'results.json'}")
    print(f"{seconds / 60:.1f} minutes")
    for name in failed:
        print(f"failed: {name}, exit status {times[name][0]}; see {folder / name}.log")
    return 1 if failed else 0


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="scripts/reproduce",
        description="Rebuild what the paper computes, and say claim by claim what reproduces. "
        "The same command again goes on where it stopped.",
    )
    parser.add_argument("--quick", action="store_true", help="thinned grids, a few minutes")
    parser.add_argument("--out", type=Path, default=Path("results/paper"), metavar="DIR")
    parser.add_argument("--only", metavar="JOB,...", help='these jobs; "none": judge what there is')
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument(
        "--share", type=float, default=0.02, help="share of the points that the audit runs again"
    )
    parser.add_argument("--no-audit", action="store_true", help="leave the audit out")
    parser.add_argument("--jobs", type=Path, default=_ROOT / "jobs/paper", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _chosen(only: str | None) -> list[str]:
    if only is None:
        return list(JOBS)
    names = [] if only == "none" else only.split(",")
    for name in names:
        if name not in JOBS:
            raise BadInput(f"--only {name}: not a job of the paper; known: {', '.join(JOBS)}")
    return [name for name in JOBS if name in names]


def run_jobs(
    names: Sequence[str], folder: Path, quick: bool, workers: int, say: Say
) -> dict[str, tuple[int, float]]:
    """Run jobs, each a process of its own; return exit status and seconds by name.

    Full jobs follow each other, all workers in one; thinned ones, too short for that, run side by
    side, those whose classes judge the others before them.
    """
    if not quick:
        return dict(_run(name, folder, False, workers, say) for name in names)
    done: dict[str, tuple[int, float]] = {}
    for stage in (
        [name for name in names if name in _ATLASES],
        [name for name in names if name not in _ATLASES and name != "robustness-2"],
        [name for name in names if name == "robustness-2"],
    ):
        with ThreadPoolExecutor(max_workers=max(workers, 1)) as pool:
            done |= dict(pool.map(lambda name: _run(name, folder, True, 1, say), stage))
    return done


def _run(
    name: str, folder: Path, quick: bool, workers: int, say: Say
) -> tuple[str, tuple[int, float]]:
    began = time.monotonic()
    place = ["--cluster", "serial"] if quick else ["--workers", str(workers)]
    settings = [word for text in (QUICK.get(name, ()) if quick else ()) for word in ("--set", text)]
    job = _ROOT / "jobs/paper" / f"{name}.toml"
    command = [sys.executable, "-P", "-m", "chimera_hpc.sweep", "run", str(job)]
    with (folder / f"{name}.log").open("w") as log:
        ended = subprocess.run(
            [*command, "--out", str(folder / name), *place, *settings],
            stdout=log,
            stderr=subprocess.STDOUT,
            check=False,
        )
    seconds = time.monotonic() - began
    say(f"{name:20s} {seconds:7.1f} s" + (f"  exit {ended.returncode}" if ended.returncode else ""))
    return name, (ended.returncode, seconds)


def write_scoreboard(
    folder: Path,
    rows: Sequence[dict[str, Any]],
    audit: dict[str, Any],
    seconds: dict[str, float],
    quick: bool,
) -> None:
    """Write results.json and claims.md of the whole reproduction."""
    from chimera_hpc.reduce.results import to_json

    if not audit:  # a later call that only judges keeps the audit there is
        try:
            audit = json.loads((folder / "results.json").read_text())["audit"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            audit = {}
    results = {"schema": 1, "quick": quick, "claims": rows, "audit": audit, "seconds": seconds}
    write_atomically(folder / "results.json", to_json(results).encode())
    text = f"# Claims of the paper\n\n{summary(rows)}.\n\n{markdown(rows)}"
    if audit:
        from chimera_hpc.paper.audit import audit_table

        text += f"\n## Audit of the labels\n\n{audit_table(audit)}"
    write_atomically(folder / "claims.md", text.encode())


if __name__ == "__main__":
    sys.exit(main())
