"""``completion``: the script that lets a shell complete this command line."""

from __future__ import annotations

from argparse import Action, ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.job.shipped import job_file

EPILOG = """examples:
  chimera-hpc completion bash > ~/.local/share/bash-completion/completions/chimera-hpc
  chimera-hpc completion zsh > ~/.zfunc/_chimera-hpc       (with fpath+=~/.zfunc before compinit)

The shell reads the script when it starts. Needs the extra: pip install 'chimera_hpc[completion]'.
"""
PROGRAM = "chimera-hpc"
SHELLS = ("bash", "zsh")


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def execute(args: Namespace) -> int:
    """Print the script."""
    try:
        import shtab
    except ModuleNotFoundError:
        raise BadInput(
            "completion: shtab is missing; pip install 'chimera_hpc[completion]' brings it"
        ) from None
    top = args.parser_named(PROGRAM)
    for action in _actions(top):
        files = {Path: shtab.FILE, job_file: shtab.FILE}.get(action.type)  # type: ignore[arg-type]
        if files is not None:
            action.complete = shtab.DIR if action.metavar == "DIR" else files  # type: ignore[attr-defined]
    print(shtab.complete(top, args.shell))
    return Exit.COMPLETE


def _actions(parser: ArgumentParser) -> Iterator[Action]:
    """Yield every argument of the parser and of its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action.choices, dict):
            for command in action.choices.values():
                yield from _actions(command)
