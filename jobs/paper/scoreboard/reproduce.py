"""``scripts/reproduce``: run every job of the paper, judge its claims, write the scoreboard."""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import write_atomically
from chimera_hpc.job.shipped import jobs_folder
from chimera_hpc.reduction.atlases import load_atlas
from chimera_hpc.run.compiled import compile_once
from scoreboard.audit_text import audit_tables, audit_text
from scoreboard.causes import read_causes
from scoreboard.chance import DRAWS, add_causes
from scoreboard.claims import DEFAULT, finding, markdown, read_claims, scoreboard, summary
from scoreboard.evidence import Evidence
from scoreboard.plan import JOBS, PRINTED, TRIPLETS, load, needs, running_order, settings

_HEAD = """\
# Claims of the paper

`scripts/reproduce` runs the jobs in `jobs/paper/`, judges the claims of `jobs/paper/claims.toml`
by the rules in `jobs/paper/scoreboard/rules.py`, and writes this page (claims.md), results.json
and the figures. `--quick` thins the grids, `--only JOB,...` runs some jobs, and `--only none`
judges the results that exist. The rules were fixed before the jobs were run. None was changed to
suit a result, with one exception: a rule that counted slow motion as an oscillation (app. C) was
corrected, and slow motion now has a claim of its own. Fractions have Wilson 95 % intervals.

Every claim is judged twice, with the same runs and the same rule: under the default convention of
the Fourier features, and under `paper-printed` ([the method](method.md)). Each convention is
applied to the whole board. Claims that do not depend on it have one measurement, and the same
outcome twice.

A claim that is reproduced under neither convention has a cause (`jobs/paper/causes.toml`). Next to
it is the number of 200 sweeps with redrawn seeds (a bootstrap of the runs of each cell) in which
the claim holds.
"""
_NOTES = "robustness.md"
"""Next to the claims: what was found of W(Q_r) besides."""

_KEPT = ("audit", "audit_printed", "seconds", "cost")

Say = Callable[[str], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    args = _parse(arguments)
    began = time.monotonic()
    folder: Path = args.out.absolute()
    try:
        names = _chosen(args.only)
        _check_needs(names, folder)
        folder.mkdir(parents=True, exist_ok=True)
    except (BadInput, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    times = run_jobs(names, folder, args.quick, args.workers, print)
    failed = [name for name, (status, _) in times.items() if status]
    audit: dict[str, Any] = {}
    under: dict[str, Any] = {}
    if not args.no_audit and not failed and names:
        from scoreboard.audit import audit_jobs, audits_under

        audit = audit_jobs(folder, names, args.share, args.workers, print)
        under = audits_under(folder, [name for name in audit if name in TRIPLETS], PRINTED)
    claims = read_claims(args.jobs / "claims.toml")
    rows = scoreboard(claims, Evidence(folder), {PRINTED: Evidence(folder, PRINTED)})
    causes = read_causes(args.jobs / "causes.toml", [claim.id for claim in claims])
    add_causes(rows, claims, folder, causes, 0 if args.quick else args.draws)
    spent = cost(time.monotonic() - began)
    notes = args.jobs / _NOTES
    made = {
        "schema": 1,
        "quick": args.quick,
        "claims": rows,
        "audit": audit,
        "audit_printed": under,
        "seconds": {name: seconds for name, (_, seconds) in times.items()},
        "cost": spent | {"jobs": len(names)} if names else {},
    }
    write_scoreboard(folder, made, notes.read_text() if notes.is_file() else "")
    for convention in (DEFAULT, PRINTED):
        print(f"{convention}: {summary(rows, convention)}")
        for row in rows:
            found = finding(row, convention)
            if found["reproduced"] is False:
                print(f"  not reproduced: {row['id']}: {found['measured']}")
    print(f"scoreboard  {folder / 'claims.md'}, {folder / 'results.json'}")
    print(f"{spent['minutes']:.1f} minutes")
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
    parser.add_argument(
        "--draws",
        type=int,
        default=DRAWS,
        metavar="N",
        help="how often the seeds are drawn again for a claim that does not reproduce; 0: not",
    )
    parser.add_argument("--no-audit", action="store_true", help="leave the audit out")
    jobs = jobs_folder() / "paper"
    parser.add_argument("--jobs", type=Path, default=jobs, help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _chosen(only: str | None) -> list[str]:
    if only is None:
        return list(JOBS)
    names = [] if only == "none" else [name.strip() for name in only.split(",")]
    for name in names:
        if name not in JOBS:
            raise BadInput(f"--only {name}: not a job of the paper; known: {', '.join(JOBS)}")
    return [name for name in JOBS if name in names]


def _check_needs(names: Sequence[str], folder: Path) -> None:
    """Raise BadInput for a job whose judging classes are neither in `folder` nor to be made."""
    for name in names:
        needed = [other for other in needs(name) if other not in names]
        missing = [other for other in needed if not _is_reduced(folder / other)]
        if missing:
            more = [other for other in JOBS if other in {*names, *needed}]
            raise BadInput(
                f"--only {name}: its runs are judged by the classes of {' and '.join(missing)}, "
                f"which are not in {folder}; run them too: --only {','.join(more)}"
            )


def _is_reduced(folder: Path) -> bool:
    try:
        return bool(load_atlas(folder).names)
    except BadInput:
        return False


def run_jobs(
    names: Sequence[str], folder: Path, quick: bool, workers: int, say: Say
) -> dict[str, tuple[int, float]]:
    """Run jobs, each a process of its own; return exit status and seconds by name.

    Two full jobs run side by side, each with half of the workers: one starts, ends and draws by
    one core. Of thinned ones, too short for workers, as many as there are workers.
    """
    at_once = max(1, workers if quick else min(2, workers))
    each = max(1, workers // at_once)
    for name in running_order(names)[:1]:
        # Two jobs that begin at the same time would both compile what they share.
        sweep = load(name, jobs_folder() / "paper", quick)
        compile_once(sweep, sweep.points(), load=False, say=say)
    running: dict[str, Future[tuple[int, float]]] = {}
    with ThreadPoolExecutor(at_once) as pool:
        for name in running_order(names):
            needed = [running[other] for other in needs(name) if other in running]
            running[name] = pool.submit(_run, name, folder, quick, each, say, needed)
    return {name: running[name].result() for name in names}


def _run(
    name: str,
    folder: Path,
    quick: bool,
    workers: int,
    say: Say,
    needed: Sequence[Future[tuple[int, float]]],
) -> tuple[int, float]:
    wait(needed)
    began = time.monotonic()
    # A single worker would compute the same in a process that takes seconds to start.
    place = ["--workers", str(workers)] if workers > 1 else ["--cluster", "serial"]
    changes = [word for text in settings(name, quick) for word in ("--set", text)]
    job = jobs_folder() / "paper" / f"{name}.toml"
    command = [sys.executable, "-P", "-m", "chimera_hpc.sweep", "run", str(job)]
    with (folder / f"{name}.log").open("w") as log:
        ended = subprocess.run(
            [*command, "--out", str(folder / name), *place, *changes],
            stdout=log,
            stderr=subprocess.STDOUT,
            check=False,
        )
    seconds = time.monotonic() - began
    say(f"{name:20s} {seconds:7.1f} s" + (f"  exit {ended.returncode}" if ended.returncode else ""))
    return ended.returncode, seconds


def cost(seconds: float) -> dict[str, float]:
    """Return what this call has used so far: wall and processor time, and how busy the machine is.

    Processor time is that of this process and of those it has waited for, without the workers that
    a fork server started.
    """
    used = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return {
        "minutes": seconds / 60.0,
        "cpu_minutes": sum(one.ru_utime + one.ru_stime for one in used) / 60.0,
        "processors": os.cpu_count() or 1,
        "load": os.getloadavg()[2],
    }


def write_scoreboard(folder: Path, made: dict[str, Any], notes: str = "") -> None:
    """Write results.json and claims.md of the whole reproduction; `notes` are its last section."""
    from chimera_hpc.reduction.results import to_json

    # A call that only judges, or runs some jobs, keeps what is known of the others.
    try:
        known = json.loads((folder / "results.json").read_text())
        made = made | {key: known.get(key, {}) | made.get(key, {}) for key in _KEPT}
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        pass
    write_atomically(folder / "results.json", to_json(made).encode())
    sums = [f"- {name}: {summary(made['claims'], name)}." for name in (DEFAULT, PRINTED)]
    parts = [_HEAD, *sums, "", *_cost_line(made["cost"])]
    parts.append(markdown(made["claims"], [PRINTED]))
    if made["audit"]:
        parts.append(f"## Audit of the labels\n\n{audit_text(made['audit'])}")
    if made.get("audit_printed"):
        text = audit_tables(made["audit_printed"])
        parts.append(f"## Audit of the labels under {PRINTED}\n\n{text}")
    text = "\n".join([*parts, notes] if notes else parts)
    write_atomically(folder / "claims.md", text.encode())


def _cost_line(spent: dict[str, float]) -> list[str]:
    if not spent:
        return []
    return [
        f"The last call that ran jobs ran {spent['jobs']} of them in {spent['minutes']:.0f} "
        f"minutes of wall time on {spent['processors']} processors; the load average at its end "
        f"was {spent['load']:.1f} (15 minutes).\n"
    ]


if __name__ == "__main__":
    sys.exit(main())
