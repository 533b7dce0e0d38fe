"""The commands of the command line, one small file each.

For developers: a command is a module with ``NAME``, ``HELP`` (one line), ``EPILOG`` (examples),
``add_arguments(parser)`` and ``execute(args) -> int``, and one line in `COMMANDS`. At import it
loads nothing heavy: `--help` must answer at once.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Protocol

from chimera_hpc.commands import (
    cancel,
    classify,
    completion,
    export,
    extend,
    merge,
    plan,
    reduce,
    retry,
    run,
    schema,
    shard,
    show,
    slurm,
    status,
    verify,
    watch,
    why,
)


class Command(Protocol):
    """What a module of this package has."""

    NAME: str
    HELP: str
    EPILOG: str

    def add_arguments(self, parser: ArgumentParser) -> None: ...
    def execute(self, args: Namespace) -> int: ...


COMMANDS: tuple[Command, ...] = (
    *(run, plan, status, watch, reduce, show, classify),
    *(retry, why, verify, extend, merge, export),
    *(slurm, shard, cancel),
    *(schema, completion),
)
