"""``watch``: the state of a sweep in the terminal, again and again, until it is done."""

from __future__ import annotations

import select
import sys
import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import add, store_path, value
from chimera_hpc.cli.cell_map import Cells
from chimera_hpc.cli.status import lines_of, map_of, state_of
from chimera_hpc.store.ledger import LedgerScan, read_metadata, scan_ledger

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

EPILOG = """examples:
  python -m chimera_hpc.sweep watch results/quickstart
  python -m chimera_hpc.sweep watch /scratch/me/plane --every 10

It only reads the store: start and stop it at any time, on any machine that sees the folder. It ends
when every point has been tried and no process works on the sweep, with exit status 0, or 1 if some
points failed.
"""
_OTHER_LINES = 14
"""Lines of the screen that the map cannot have."""


def add_arguments(parser: ArgumentParser) -> None:
    add(parser, "folder", every=value("SECONDS", _seconds, "pause (default: 2)", default=2.0))


def execute(args: Namespace) -> int:
    from rich.console import Console
    from rich.live import Live

    path = store_path(args.folder)
    console = Console(highlight=False)
    view = _View(path, console)
    if not console.is_terminal:
        return _follow(view, args.every)
    # On the screen's other page a map that shrinks or grows leaves nothing behind.
    with Live(view.look(), console=console, auto_refresh=False, screen=True) as live:
        while not view.over:
            time.sleep(args.every)
            live.update(view.look(), refresh=True)
    console.print(view.look())
    return view.exit_status


def _follow(view: _View, every: float) -> int:
    """Print a line at each change, for pipes and logs."""
    last = ""
    while True:
        view.look()
        line = lines_of(view.state)[0]
        if line != last:
            print(line, flush=True)
            last = line
        if view.over:
            return view.exit_status
        _wait(every)


def _wait(seconds: float) -> None:
    """Wait; raise BrokenPipeError when nothing reads the output any more."""
    try:
        output = sys.stdout.fileno()
    except OSError:
        time.sleep(seconds)
        return
    poll = select.poll()
    poll.register(output, 0)
    if poll.poll(1e3 * seconds):
        raise BrokenPipeError


class _View:
    """What is seen of a store, and whether there is more to come."""

    def __init__(self, path: Path, console: Console) -> None:
        self._path, self._console = path, console
        self._cells: Cells | None = None
        self._known: tuple[object, ...] = ()
        self.state: dict[str, Any] = {}

    @property
    def over(self) -> bool:
        """Whether every point was tried and no process works on any."""
        return not self.state["pending"] and not self.state["blocks_running"]

    @property
    def exit_status(self) -> int:
        return Exit.of_points(self.state["pending"], self.state["failed"])

    def look(self) -> RenderableType:
        from rich.console import Group
        from rich.padding import Padding
        from rich.progress_bar import ProgressBar
        from rich.text import Text

        metadata = read_metadata(self._path)
        scan = scan_ledger(self._path, metadata)
        self.state = state_of(self._path, metadata, scan)
        head, *rest = lines_of(self.state)
        tried = self.state["points"] - self.state["pending"]
        width = min(60, self._console.width)
        parts: list[RenderableType] = [
            Text(head, style="bold"),
            # A bar alone does not end its line.
            Padding(ProgressBar(total=self.state["points"], completed=tried, width=width), 0),
            Text("\n".join(rest)),
        ]
        found = self._map(metadata, scan)
        if found is not None:
            parts += [Text(), found]
        return Group(*parts)

    def _map(self, metadata: dict[str, Any], scan: LedgerScan) -> RenderableType | None:
        """Return the map; what cells there are is read again only where it may have changed."""
        results = self._path.parent / "results.json"
        known = (metadata["attributes"]["n_points"], _changed(results))
        if known != self._known:
            self._cells, self._known = Cells.read(self._path, metadata), known
        height = max(4, self._console.height - _OTHER_LINES)
        return map_of(self._cells, scan, self._console, height)


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.1 <= value <= 3600.0:
        raise ArgumentTypeError(f"{text}: seconds from 0.1 to 3600 are allowed")
    return value
