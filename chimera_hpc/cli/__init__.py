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
    Command("run", "run a sweep, or continue one, and reduce it"),
    Command(
        "plan",
        "print what a sweep would cost: points, blocks, files, bytes, core-hours; starts nothing",
    ),
    Command("status", "print what is done, from the store alone, during or after a run"),
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
    Command("why", "explain the outcome of one point: status, tries, run, code and machine"),
    Command("verify", "check the stored data, and recompute a sample of the points"),
    Command("audit", "test how reliable the classes are: recompute a sample, resample the seeds"),
    Command(
        "extend", "add points to a sweep: more seeds, new values on any axis; computes nothing"
    ),
    Command("merge", "merge several sweeps that differ only in their axes"),
    Command(
        "export",
        "write results as NetCDF, as a CSV table of the triplets, or as a zip with the report",
    ),
    Command("slurm", "print the batch script of a sweep for SLURM, or submit it"),
    Command("shard", "compute one share of a sweep's blocks, straight into its store"),
    Command("cancel", "cancel a sweep's SLURM jobs, and remove what a killed driver left"),
    Command(
        "schema", "print the JSON Schema of the job file, for checks and completion in editors"
    ),
    Command("completion", "print the shell completion script of chimera-hpc"),
)
