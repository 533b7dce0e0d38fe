"""Commands in processes of their own, measured; and the table of what was found."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

MB = 1e6


@dataclass(frozen=True)
class Line:
    """One line of the table."""

    what: str
    measured: float
    unit: str
    limit: float
    at_least: bool = False
    before: str = ""
    """Measured on version 0.1."""

    @property
    def good(self) -> bool:
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit

    def words(self) -> list[str]:
        sign = ">=" if self.at_least else "<="
        unit = f" {self.unit}".rstrip()
        return [
            self.what,
            self.before,
            f"{self.measured:.3g}{unit}",
            f"{sign} {self.limit:g}{unit}",
        ]


def table(lines: list[Line]) -> str:
    """Return the table as Markdown."""
    rows = [["measured", "0.1", "value", "limit"], ["---"] * 4, *(line.words() for line in lines)]
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    return "\n".join(
        "| " + " | ".join(w.ljust(n) for w, n in zip(row, widths, strict=True)) + " |"
        for row in rows
    )


@dataclass(frozen=True)
class Done:
    """A command that has ended."""

    seconds: float
    memory: int
    """Most bytes that it occupied."""
    text: str
    path: Path = Path()


def peak_memory(pid: int) -> int:
    """Return the most bytes that a process has occupied since it began its program.

    `resource.getrusage` would count the memory of the process that started it, too.
    """
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    found = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    return 1024 * found[0] if found else 0


def run(*arguments: object, good: tuple[int, ...] = (0,)) -> Done:
    """Run Python with these arguments, and measure it; another exit status than these ends all."""
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *map(str, arguments)], stdout=subprocess.PIPE, text=True
    )
    memory = 0
    while process.poll() is None:
        memory = max(memory, peak_memory(process.pid))
        time.sleep(0.01)
    seconds = time.perf_counter() - began
    assert process.stdout is not None
    with process.stdout as output:
        text = output.read()
    if process.returncode not in good:
        raise SystemExit(f"{arguments} ended with {process.returncode}: {text}")
    return Done(seconds, memory, text)
