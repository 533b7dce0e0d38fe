"""``completion``: the script that lets a shell complete this command line."""

from __future__ import annotations

from argparse import Action, ArgumentParser, Namespace
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import job_name, path_name

EPILOG = """examples:
  chimera-hpc completion bash > ~/.local/share/bash-completion/completions/chimera-hpc
  chimera-hpc completion zsh > ~/.zfunc/_chimera-hpc       (with fpath+=~/.zfunc before compinit)

The shell reads the script when it starts. Needs the extra: pip install 'chimera_hpc[completion]'.
"""
PROGRAM = "chimera-hpc"
SHELLS = ("bash", "zsh")


def add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def execute(args: Namespace) -> int:
    try:
        import shtab
    except ModuleNotFoundError:
        raise BadInput(
            "completion: shtab is missing; pip install 'chimera_hpc[completion]' brings it"
        ) from None
    print(shtab.complete(args.parser_named(PROGRAM, kind=_Parser), args.shell))
    return Exit.COMPLETE


class _Parser(ArgumentParser):
    """A parser that tells shtab which of its arguments are files and folders."""

    def add_argument(self, *names: Any, **options: Any) -> Action:
        """Declare an argument. Those of a group do not pass here: only --links is a file."""
        import shtab

        action = super().add_argument(*names, **options)
        if action.type in (path_name, job_name):
            files = shtab.DIR if action.metavar == "DIR" else shtab.FILE
            action.complete = files  # type: ignore[attr-defined]
        return action
