"""``plan``: what a sweep would cost; starts nothing."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chimera_hpc.commands.arguments import add_block, add_job, load_job
from chimera_hpc.commands.exits import Exit
from chimera_hpc.grid import block_size
from chimera_hpc.grid.blocks import point_seconds
from chimera_hpc.layout import room

NAME = "plan"
HELP = "say what a sweep would cost: points, blocks, files, bytes, core-hours; starts nothing"
EPILOG = """examples:
  python -m chimera_hpc.sweep plan jobs/quickstart.toml
  python -m chimera_hpc.sweep plan jobs/quickstart.toml --set seeds=100 --set keep.series=none
"""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_job(parser)
    add_block(parser)


def execute(args: Namespace) -> int:
    """Print the plan."""
    sweep = load_job(args.job, args.overrides, args.block)
    points = sweep.points()
    size = block_size(sweep, len(points))
    need = room(sweep, points.columns, size)
    cells = len(points.cells()[1]["P"])
    seconds = point_seconds(sweep) * len(points)
    print(f"sweep       {sweep.name} ({sweep.model}), digest {sweep.digest}")
    print(f"axes        {', '.join(points.axes)}")
    print(f"points      {len(points)} in {cells} cells")
    print(f"blocks      {need.blocks} of up to {size} points")
    print(f"files       {need.files}")
    print(f"store       {in_bytes(need.bytes)} at most")
    print(f"work        about {in_time(seconds)} on one core")
    return Exit.COMPLETE


def in_bytes(size: float) -> str:
    """Write a number of bytes for people."""
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if size < 1000 or unit == "TB":
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.3g} {unit}"
        size /= 1000
    raise AssertionError


def in_time(seconds: float) -> str:
    """Write a duration for people."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.3g} h"
