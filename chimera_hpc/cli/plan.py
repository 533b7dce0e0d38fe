"""``plan``: prints what a sweep would cost; starts nothing."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

import numpy as np

from chimera_hpc.base.exits import Exit
from chimera_hpc.base.wording import in_bytes, in_time
from chimera_hpc.cli.arguments import STORE, add
from chimera_hpc.cli.deciding import plan_line
from chimera_hpc.cli.estimate import estimate, memory_lines, refuse_absurd
from chimera_hpc.cli.jobs import load_job, sweep_folder
from chimera_hpc.cli.run import check_drawing
from chimera_hpc.job import Sweep
from chimera_hpc.job.class_names import overridden
from chimera_hpc.job.models import build
from chimera_hpc.network.sweep_network import network_of

EPILOG = """examples:
  python -m chimera_hpc.sweep plan jobs/quickstart.toml
  python -m chimera_hpc.sweep plan jobs/quickstart.toml --set seeds=100 --set keep.series=none

A plan with more than 500,000 files, more than 100,000 core-hours, or more bytes than are free on
the disk is refused with exit status 2, also by `run`; --yes accepts it.
"""


def add_arguments(parser: ArgumentParser) -> None:
    add(parser, "job", "--set", "--out", "--block", "--yes")


def execute(args: Namespace) -> int:
    sweep = load_job(args.job, args.overrides, args.block)
    check_drawing(sweep)
    folder = sweep_folder(args.out, sweep, args.job)
    need = estimate(sweep)
    print(f"sweep       {sweep.name} ({sweep.model}), digest {sweep.digest}")
    if sweep.network is not None:
        print(f"network     {sweep.network.kind}; {_coupling(sweep)}")
    print(f"axes        {', '.join(need.axes)}")
    print(f"points      {need.points} in {need.cells} cells")
    if (chains := sweep.continue_) is not None:
        way = "both ways" if chains.direction == "both" else chains.direction
        print(f"chains      {need.blocks} of {need.block} points along {chains.along}, {way}")
    if sweep.decide is not None:
        print(plan_line(sweep, folder / STORE))
    print(f"blocks      {need.blocks} of up to {need.block} points")
    print(f"files       {need.files}")
    print(f"store       {in_bytes(need.bytes)} at most")
    print(f"work        about {in_time(need.seconds)} on one core")
    print("\n".join(memory_lines(need)))
    for line in overridden(sweep.features):
        print(f"warning: {line}")
    refuse_absurd(sweep, need, folder, args.yes)
    return Exit.COMPLETE


def _coupling(sweep: Sweep) -> str:
    """Return the network of the first point, and how a slope is computed there."""
    row = sweep.points().row(0)
    kernel = getattr(build(sweep, row), "kernel", "the model's own right-hand side")
    network = network_of(sweep, row)
    alone = np.setdiff1d(np.arange(network.n_nodes), network.links)
    size = f"the first point {network.n_nodes} nodes, {network.n_links} links"
    if len(alone):
        first = ", nodes count from 0" if alone[0] == 0 else ""
        size += f", {len(alone)} nodes without any ({alone[0]}{', ...' * (len(alone) > 1)}{first})"
    return f"{size}, by {kernel}"
