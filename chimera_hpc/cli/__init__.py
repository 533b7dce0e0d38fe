"""The command line: one small file per command.

For developers: a command is one line in `COMMANDS` and a module of its name with ``EPILOG``
(examples), ``add_arguments(parser)`` and ``execute(args) -> int``. The module is loaded when the
command is typed; what is heavy it loads when it is needed, for its `--help` must answer at once.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol, cast


class Module(Protocol):
    """What a module of this package has."""

    EPILOG: str

    def add_arguments(self, parser: ArgumentParser) -> None: ...
    def execute(self, args: Namespace) -> int: ...


@dataclass(frozen=True)
class Command:
    """A command: its name, and one line on what it does."""

    name: str
    help: str

    @property
    def module(self) -> Module:
        return cast(Module, import_module(f"{__name__}.{self.name}"))


COMMANDS = (
    Command("run", "run a sweep, or go on with one, and reduce it"),
    Command(
        "plan",
        "say what a sweep would cost: points, blocks, files, bytes, core-hours; starts nothing",
    ),
    Command("status", "say what is done, from the store alone, while a sweep runs or after"),
    Command("watch", "show the state of a sweep in the terminal until it is done"),
    Command("reduce", "make results.json, figures and the report from what is in the store"),
    Command(
        "show",
        "recompute a point or a cell and draw it: space-time plot, profiles, portrait, spectrum",
    ),
    Command(
        "classify", "measure a recording of your own, and classify it by the classes of a sweep"
    ),
    Command("retry", "compute failed points once more, and reduce"),
    Command("why", "explain what became of one point: status, tries, who computed it, with what"),
    Command("verify", "decode what is stored, and recompute a sample of the points"),
    Command("audit", "say how firm the classes are: recompute a sample, resample the seeds"),
    Command(
        "extend", "add points to a sweep: more seeds, new values on any axis; computes nothing"
    ),
    Command("merge", "make one sweep of several that differ in their axes only"),
    Command(
        "export",
        "write results as NetCDF, as a CSV table of the triplets, or all that matters as a zip",
    ),
    Command("slurm", "print the batch script of a sweep for SLURM, or submit it"),
    Command("shard", "compute one share of a sweep's blocks, straight into its store"),
    Command("cancel", "cancel a sweep's SLURM jobs, and what a killed driver left behind"),
    Command(
        "schema", "print the JSON Schema of the job file, with which editors check and complete one"
    ),
    Command("completion", "print what lets a shell complete the command chimera-hpc"),
)
