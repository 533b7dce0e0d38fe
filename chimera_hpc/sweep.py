"""The command line: ``python -m chimera_hpc.sweep COMMAND ...``."""

from __future__ import annotations

import gc
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence

from chimera_hpc import __version__
from chimera_hpc.commands import COMMANDS
from chimera_hpc.commands.exits import Exit
from chimera_hpc.errors import BadInput

_EXITS = """exit status:
  0 every point has a result; 1 some failed (listed); 2 bad input (one line);
  75 stopped in good order with more to do; 130 Ctrl-C
"""

_OBJECTS = 50_000
"""New objects after which Python looks for garbage."""


def parser(program: str = "python -m chimera_hpc.sweep") -> ArgumentParser:
    """Return the parser of the whole command line, called by this name."""
    top = ArgumentParser(
        prog=program,
        description="Parameter sweeps of oscillator networks: integrate, store, classify, draw.",
        epilog="Each command has its own --help with examples.\n\n" + _EXITS,
        formatter_class=RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"chimera_hpc {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in COMMANDS:
        sub = commands.add_parser(
            command.NAME,
            help=command.HELP,
            description=command.HELP[0].upper() + command.HELP[1:] + ".",
            epilog=command.EPILOG + "\n" + _EXITS,
            formatter_class=RawDescriptionHelpFormatter,
        )
        command.add_arguments(sub)
        sub.set_defaults(execute=command.execute)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; `BadInput` becomes one line and status 2."""
    # Most of what a command imports is no garbage: looking for some takes a tenth of a second.
    gc.set_threshold(_OBJECTS)
    args = parser().parse_args(arguments)
    args.typed = sys.argv[1:] if arguments is None else list(arguments)
    args.parser_named = parser
    try:
        return int(args.execute(args))
    except BadInput as error:
        print(f"error: {error}", file=sys.stderr)
        return Exit.BAD_INPUT
    except BrokenPipeError:
        sys.stderr.close()
        return Exit.COMPLETE
    except KeyboardInterrupt:
        return Exit.INTERRUPTED


if __name__ == "__main__":
    status = main()
    # Nor is it when Python ends, which would look through it once more.
    gc.freeze()
    sys.exit(status)
