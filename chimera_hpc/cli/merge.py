"""``merge``: one sweep's folder of several."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import STORE, add, path_name, store_path, value
from chimera_hpc.cli.ending import MOST_LINES, name_of

if TYPE_CHECKING:
    from chimera_hpc.store.merge import Merged
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep merge results/seeds-0-19 results/seeds-20-39 --out results/all

The sweeps may overlap. A point that several sweeps have is taken from the first that has a result
for it. If their results differ, the point is listed, and the exit status is 1.
"""


def add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("folders", **value("DIR", path_name, "folders of sweeps", nargs="+"))
    add(parser, out=value("DIR", path_name, "the new folder", required=True))


def execute(args: Namespace) -> int:
    if len(args.folders) < 2:
        raise BadInput("merge: at least two folders are needed")
    paths = [store_path(folder) for folder in args.folders]
    out = args.out.absolute()
    if out.exists() and not out.is_dir():
        raise BadInput(f"{out}: not a folder")
    from chimera_hpc.store.blocks import DamagedChunk
    from chimera_hpc.store.merge import merge
    from chimera_hpc.store.store import Store

    try:
        merged = merge(out / STORE, [Store.open(path) for path in paths])
    except DamagedChunk as error:
        raise BadInput(str(error)) from None
    _tell(merged, args.folders, Store.open(out / STORE))
    return Exit.FAILURES if len(merged.conflicts) else Exit.COMPLETE


def _tell(merged: Merged, folders: list[Path], store: Store) -> None:
    for folder, count in zip(folders, merged.taken, strict=True):
        print(f"{count} points from {folder}")
    print(f"{merged.n_points} points in {store.path}")
    if len(merged.conflicts):
        print(f"{len(merged.conflicts)} points have different results; the first one was taken:")
    for i in merged.conflicts[:MOST_LINES].tolist():
        print(f"  {name_of(store, i)}")
    if len(merged.conflicts) > MOST_LINES:
        print(f"  and {len(merged.conflicts) - MOST_LINES} more")
