"""The command line: ``python -m chimera_hpc.sweep COMMAND ...``."""

from __future__ import annotations

import os
import re
import sys
import warnings
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from chimera_hpc import __version__
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.places import prepare_home
from chimera_hpc.base.renaming import IS_RENAMING
from chimera_hpc.run.watchdog import give_up, watchdog

_EXITS = """exit status:
  0 every point has a result; 1 some failed (listed); 2 bad input (one line);
  74 the output cannot be written; 75 stopped cleanly, points are pending; 130 Ctrl-C
"""

_INTERRUPTED = 130


class OneLineParser(ArgumentParser):
    """A parser that says what is wrong with a command line in one line, without the usage."""

    def error(self, message: str) -> NoReturn:
        """Leave with exit status 2."""
        line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)
        self.exit(2, f"error: {line}; {self.prog} --help shows the usage\n")


def parser(
    program: str = "python -m chimera_hpc.sweep",
    typed: Sequence[str] | None = None,
    kind: type[ArgumentParser] = OneLineParser,
) -> ArgumentParser:
    """Return the parser of the whole command line, called by this name.

    It and the parsers of the commands are of the class `kind`. It knows the arguments of all
    commands, or where `typed` is given only of those that are named in it: the others need not be
    loaded then.
    """
    from chimera_hpc.cli import COMMANDS

    top = kind(
        prog=program,
        description="Parameter sweeps of oscillator networks: integrate, store, classify, draw.",
        epilog="Each command has its own --help with examples.\n\n" + _EXITS,
        formatter_class=RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"chimera_hpc {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in COMMANDS:
        sub = commands.add_parser(command.name, help=command.help)
        if typed is None or command.name in typed:
            sub.description = command.help[0].upper() + command.help[1:] + "."
            sub.epilog = command.module.EPILOG + "\n" + _EXITS
            sub.formatter_class = RawDescriptionHelpFormatter
            command.module.add_arguments(sub)
            sub.set_defaults(execute=command.module.execute)
    return top


def main(arguments: Sequence[str] | None = None, program: list[str] | None = None) -> int:
    """Run one command and return its exit status; `BadInput` becomes one line and status 2.

    `program` is the command line of this process if it runs nothing else: then the command may end
    the process, or have the program started again in its place, should a model not return.
    """
    typed = sys.argv[1:] if arguments is None else list(arguments)
    try:
        return _execute(typed, program)
    except KeyboardInterrupt:
        return _INTERRUPTED


def _execute(typed: list[str], program: list[str] | None) -> int:
    from chimera_hpc.base.exits import Exit

    args = parser(typed=typed).parse_args(typed)
    args.typed, args.program = typed, program
    if program is not None:
        watchdog.on_hang = give_up
        watchdog.listen()
        prepare_home()
    args.parser_named = parser
    try:
        with _plain_notes():
            return int(args.execute(args))
    except BadInput as error:
        print(f"error: {error}", file=sys.stderr)
        return Exit.BAD_INPUT
    except BrokenPipeError:
        # The reader has what it wants, as `head` does.
        return Exit.COMPLETE
    except OSError as error:
        where = "the output" if error.filename is None else error.filename
        print(f"error: {where}: {error.strerror or error}", file=sys.stderr)
        return Exit.NO_OUTPUT if error.filename is None else Exit.BAD_INPUT


@contextmanager
def _plain_notes() -> Iterator[None]:
    """Show that something was renamed as one line, as long as the command runs."""
    with warnings.catch_warnings():
        warnings.filterwarnings("always", message=IS_RENAMING, category=FutureWarning)
        before: Any = warnings.showwarning
        said: set[str] = set()

        def show(message: Warning | str, category: type[Warning], *rest: Any, **named: Any) -> None:
            if not re.match(IS_RENAMING, str(message)):
                before(message, category, *rest, **named)
            elif str(message) not in said:
                said.add(str(message))
                print(f"note: {message}", file=sys.stderr)

        warnings.showwarning = show
        yield


def run() -> NoReturn:
    """Run the command line and leave with its exit status."""
    status = main(program=sys.orig_argv)
    # A KeyboardInterrupt out of text that Python compiled has it end by SIGINT, although it was
    # caught, until it compiles another one.
    eval("0")
    sys.exit(_with_output(status))


def _with_output(status: int) -> int:
    """Write what is left to be printed; return the exit status, another one if that fails."""
    from chimera_hpc.base.exits import Exit

    try:
        sys.stdout.flush()
    except OSError as error:
        # Python would try again at its end, and print a traceback.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            print(f"error: the output: {error.strerror}", file=sys.stderr)
            return status or Exit.NO_OUTPUT
    return status
