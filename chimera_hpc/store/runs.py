"""One small file per run in the folder `runs` of a store: who wrote which points, how and when."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import create_exclusively, write_atomically

FOLDER = "runs"


@dataclass(frozen=True)
class BlockWork:
    """Points of blocks that have ended, and the wall time that these blocks took, summed.

    The time includes measuring and writing. With one core per worker, it is work of one core.
    """

    points: int
    seconds: float

    def __add__(self, other: BlockWork) -> BlockWork:
        return BlockWork(self.points + other.points, self.seconds + other.seconds)

    def record(self) -> dict[str, Any]:
        """Return the keys of `record_work` that hold it."""
        return {"points": self.points, "core_seconds": round(self.seconds, 3)}


def block_work(path: Path) -> BlockWork:
    """Return the work of all runs that have recorded it; version 0.1 did not."""
    found = BlockWork(0, 0.0)
    for number in run_numbers(path):
        work = read_work(path, number)
        points, seconds = work.get("points"), work.get("core_seconds")
        if isinstance(points, int) and isinstance(seconds, int | float):
            found += BlockWork(points, float(seconds))
    return found


def start_run(path: Path, info: Mapping[str, Any]) -> int:
    """Create ``runs/<number>.json`` with `info` and return its number, which no other run has.

    Numbers count from 1; the ledger's field `run` holds them.
    """
    folder = path / FOLDER
    folder.mkdir(exist_ok=True)
    number = max(run_numbers(path), default=0) + 1
    while not create_exclusively(_file(path, number), _content(number, info)):
        number += 1
    return number


def run_numbers(path: Path) -> list[int]:
    """Return the numbers of all runs, rising."""
    folder = path / FOLDER
    names = os.listdir(folder) if folder.is_dir() else []
    parts = [name.removesuffix(".json") for name in names if name.endswith(".json")]
    return sorted(int(part) for part in parts if part.isdecimal())


def read_run(path: Path, number: int) -> dict[str, Any]:
    """Return what a run wrote about itself; raise BadInput when it is not there or unreadable."""
    try:
        info = json.loads(_file(path, number).read_bytes())
    except (OSError, ValueError, RecursionError):
        info = None
    if not isinstance(info, dict):
        raise BadInput(f"{path}: run {number} has left no readable record")
    return info


def record_work(path: Path, number: int, info: Mapping[str, Any]) -> None:
    """Write ``runs/<number>.work.json``: what is known of a run's work so far, or at its end."""
    write_atomically(_work(path, number), json.dumps(dict(info), indent=1).encode())


def read_work(path: Path, number: int) -> dict[str, Any]:
    """Return what `record_work` wrote; nothing where that is not there or unreadable."""
    try:
        info = json.loads(_work(path, number).read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return info if isinstance(info, dict) else {}


def _work(path: Path, number: int) -> Path:
    return path / FOLDER / f"{number}.work.json"


def _file(path: Path, number: int) -> Path:
    return path / FOLDER / f"{number}.json"


def _content(number: int, info: Mapping[str, Any]) -> bytes:
    return json.dumps({"run": number, **info}, indent=1).encode()
