"""Work without executor and store: the blocks of a sweep, or dgemm, in some processes.

Called as a script, this is one of the processes.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from turns import Program

_PRODUCT = 128
"""Rows of a matrix that dgemm multiplies: three of them fit into the second cache of a core."""
_PRODUCTS = 1000
"""Products in a piece of work."""


def program(kind: str, processes: int, words: Sequence[str], folder: Path) -> Program:
    """Return a program of so many processes, each of which takes the next piece that is left."""
    return Program([command(kind, words, folder)] * processes, prepares=True)


def command(kind: str, words: Sequence[str], folder: Path) -> list[str]:
    """Return the command line of a process; it shares the work with others of this command line."""
    claims = tempfile.mkdtemp(prefix="claims-", dir=folder)
    return [sys.executable, __file__, kind, claims, *words]


def _blocks(job: str, *settings: str) -> list[Callable[[], object]]:
    from functools import partial

    from chimera_hpc.job import Sweep
    from chimera_hpc.job.blocks import block_size, blocks
    from chimera_hpc.run.block import run_block, warm_up

    sweep = Sweep.load(Path(job), settings)
    points = sweep.points()
    warm_up(sweep, points)
    cuts = blocks(len(points), block_size(sweep, len(points)))
    return [partial(run_block, sweep, points[slice(start, stop)]) for start, stop in cuts]


def _dgemm(pieces: str) -> list[Callable[[], object]]:
    import numpy as np

    a = np.random.default_rng(0).random((_PRODUCT, _PRODUCT))
    product = np.empty_like(a)

    def multiply() -> None:
        for _ in range(_PRODUCTS):
            np.matmul(a, a, out=product)

    multiply()
    return [multiply] * int(pieces)


def _left(claims: str, work: Sequence[Callable[[], object]]) -> Iterator[Callable[[], object]]:
    for k, piece in enumerate(work):
        try:
            os.mkdir(os.path.join(claims, str(k)))
        except FileExistsError:
            continue
        yield piece


def main() -> None:
    """Prepare, say so, wait to be told a line, and do what no other process has taken."""
    kind, claims, *words = sys.argv[1:]
    work = _blocks(*words) if kind == "blocks" else _dgemm(*words)
    print("ready", flush=True)
    sys.stdin.readline()
    for piece in _left(claims, work):
        piece()
    os._exit(0)


if __name__ == "__main__":
    main()
