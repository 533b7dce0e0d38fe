"""``schema``: the JSON Schema of the job file."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chimera_hpc.base.exits import Exit
from chimera_hpc.job.schema import schema_text

EPILOG = """examples:
  python -m chimera_hpc.sweep schema > job.schema.json

An editor with a TOML language server (Taplo, Even Better TOML) reads it when the first line of the
job file is
  #:schema job.schema.json
"""


def add_arguments(parser: ArgumentParser) -> None:
    pass


def execute(args: Namespace) -> int:
    print(schema_text(), end="")
    return Exit.COMPLETE
