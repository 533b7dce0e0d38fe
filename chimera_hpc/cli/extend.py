"""``extend``: more seeds, new values on any axis; finished points stay as they are."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import add, errors_in_one_line, store_path
from chimera_hpc.cli.estimate import estimate, refuse_absurd
from chimera_hpc.cli.jobs import load_job, sweep_folder

EPILOG = """examples:
  python -m chimera_hpc.sweep extend jobs/quickstart.toml --set seeds=40
  python -m chimera_hpc.sweep extend jobs/quickstart.toml --set P=2:30 --out results/quickstart
  python -m chimera_hpc.sweep extend results/quickstart --set seeds=40

You may give the sweep's folder instead of a job file, because its store holds the whole job. The
job, with its --set values, must have all points of the sweep and may differ only in its axes. The
new points come after the old ones, which do not change; `run DIR` computes them.
"""


def add_arguments(parser: ArgumentParser) -> None:
    add(parser, "job", "--set", "--out", "--yes")


def execute(args: Namespace) -> int:
    sweep = load_job(args.job, args.overrides)
    folder = sweep_folder(args.out, sweep, args.job)
    path = store_path(folder)
    refuse_absurd(sweep, estimate(sweep), folder, args.yes)
    from chimera_hpc.store.store import Store

    with errors_in_one_line(path):
        before = Store.open(path)
        after = before.extend(sweep)
    more = after.n_points - before.n_points
    print(f"{more} points added, {after.n_points} in all, in {after.n_blocks} blocks")
    if more:
        print(f"to compute them: run {folder}")
    return Exit.COMPLETE
