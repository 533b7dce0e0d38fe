"""``reduce``: classes, curves, results.json and figures from what is in the store."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chimera_hpc.base.exits import Exit
from chimera_hpc.base.status import Status
from chimera_hpc.cli.arguments import STORE, add, errors_in_one_line, flag, store_path
from chimera_hpc.cli.reporting import reduce_and_report
from chimera_hpc.store.ledger import read_ledger

EPILOG = """examples:
  python -m chimera_hpc.sweep reduce results/quickstart
"""


def add_arguments(parser: ArgumentParser) -> None:
    complete = "only if every point was tried; else exit status 75"
    add(parser, "folder", no_figures=flag("results.json only"), complete=flag(complete))


def execute(args: Namespace) -> int:
    folder = store_path(args.folder).parent
    if args.complete:
        left = int((read_ledger(folder / STORE)["status"] == Status.NEVER).sum())
        if left:
            print(f"{folder}: {left} points are left to compute; nothing reduced")
            return Exit.MORE_TO_DO
    with errors_in_one_line(args.folder):
        reduce_and_report(folder, make_figures=not args.no_figures)
    return Exit.COMPLETE
