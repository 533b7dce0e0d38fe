"""``reduce``: classes, curves, results.json and figures from what is in the store."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chimera_hpc.commands.arguments import add_folder, store_path
from chimera_hpc.commands.exits import Exit
from chimera_hpc.errors import BadInput

NAME = "reduce"
HELP = "make results.json, figures and the report from what is in the store"
EPILOG = """examples:
  python -m chimera_hpc.sweep reduce results/quickstart
"""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_folder(parser)
    parser.add_argument("--no-figures", action="store_true", help="results.json only")


def execute(args: Namespace) -> int:
    """Reduce the sweep in a folder, finished or not."""
    folder = store_path(args.folder).parent
    from chimera_hpc.outputs import reduce_sweep
    from chimera_hpc.store import DamagedChunk

    try:
        reduce_sweep(folder, make_figures=not args.no_figures, say=print)
    except DamagedChunk as error:
        raise BadInput(f"{args.folder}: {error}") from None
    except OSError as error:
        where = error.filename or args.folder
        raise BadInput(f"{where}: can't be written: {error.strerror or error}") from None
    return Exit.COMPLETE
