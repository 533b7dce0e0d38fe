"""``audit``: how reliable the classes of a sweep are, the error bar of its phase diagram."""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.base.processes import usable_cores
from chimera_hpc.cli.arguments import add, errors_in_one_line, flag, store_path, value
from chimera_hpc.job.user_models import prints_to_stderr

if TYPE_CHECKING:
    from chimera_hpc.reduction.audit import Sample

EPILOG = """examples:
  python -m chimera_hpc.sweep audit results/quickstart
  python -m chimera_hpc.sweep audit results/quickstart --points 100 --seed 1

A sample of the points, spread evenly over the cells, is computed again in three ways: at 100 times
tighter tolerances; from an initial state moved by 1e-13 (the control, because runs near the border
of two classes are chaotic); and over a run five times as long, analysed at its end. All runs are
labelled by the classes of the last reduction. The seeds of every cell are also resampled, to find
how often its modal class stays the same. results.json keeps the result under "audit" until points
or classes change; figures and report show it. The stored points do not change.
"""
_SHARE = 0.05


def add_arguments(parser: ArgumentParser) -> None:
    add(
        parser,
        *("folder", "--json"),
        share=value("X", float, f"share of points to compute again, 0 to 1 (default: {_SHARE})"),
        points=value("N", int, "number of points to compute again, in place of --share"),
        seed=value("K", int, "chooses the sample", default=0),
        workers=value("N", int, "worker processes (default: one per core; 1: no other process)"),
        no_figures=flag("results.json only"),
    )


def execute(args: Namespace) -> int:
    sample = _sample(args)
    workers = usable_cores() if args.workers is None else args.workers
    if workers < 0:
        raise BadInput(f"--workers {workers}: allowed is 0 or more")
    folder = store_path(args.folder).parent
    from chimera_hpc.reduction.audit import audit_sweep
    from chimera_hpc.reduction.audit_text import audit_lines

    with errors_in_one_line(args.folder), prints_to_stderr():
        audit = audit_sweep(folder, sample, workers=workers, on_piece=_progress)
        made = [] if args.no_figures else _draw(folder)
    _print(audit, [] if args.json else [*audit_lines(audit), *made], args.json)
    return Exit.COMPLETE


def _print(audit: dict[str, Any], lines: list[str], as_json: bool) -> None:
    for line in [json.dumps(audit, allow_nan=False)] if as_json else lines:
        print(line)


def _sample(args: Namespace) -> Sample:
    from chimera_hpc.reduction.audit import Sample

    if args.share is not None and args.points is not None:
        raise BadInput("--share and --points: one of them")
    share = _SHARE if args.share is None else args.share
    if not 0.0 < share <= 1.0:
        raise BadInput(f"--share {share}: a share above 0, up to 1, is needed")
    if args.points is not None and args.points < 1:
        raise BadInput(f"--points {args.points}: allowed is 1 or more")
    if args.seed < 0:
        raise BadInput(f"--seed {args.seed}: must not be below 0")
    return Sample(share, args.points, args.seed)


def _progress(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r{done} of {total} runs", end="\n" if done == total else "", file=sys.stderr)


def _draw(folder: Path) -> list[str]:
    """Draw figures and report again, which now show the audit; return where they are."""
    from chimera_hpc.reduction.reduction import reduce_sweep
    from chimera_hpc.report import write_report

    summary = reduce_sweep(folder)
    return [f"results  {summary.results}", f"report   {write_report(folder).path}"]
