"""Compare checkouts: the same command, whole, by turns.

    python tests/bench/versions.py BEFORE AFTER --pairs 5 -- jobs/quickstart.toml --no-figures

Each checkout needs its ``.venv``, which `scripts/test --version` makes. Kernels are compiled before
the first round, unless `--cold` gives each run an empty cache. Prints wall seconds, and processor
seconds of all processes, which say more on a machine that others use too.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from statistics import median

_SET_CHILD_SUBREAPER = 36  # of Linux's prctl: this process inherits orphans, and their times


def run_once(checkout: Path, words: list[str], cold: bool) -> tuple[float, float]:
    """Return wall and processor seconds of one run into an empty folder."""
    with tempfile.TemporaryDirectory() as scratch:
        cache = {"NUMBA_CACHE_DIR": f"{scratch}/kernels"} if cold else {}
        program = [str(checkout / ".venv/bin/python"), "-P", "-m", "chimera_hpc.sweep", "run"]
        began, before = time.perf_counter(), os.times()
        subprocess.run(
            [*program, *words, "--out", f"{scratch}/out"],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": str(checkout), **cache},
            check=True,
            capture_output=True,
        )
        wall = time.perf_counter() - began
        with suppress(ChildProcessError):
            while True:
                os.wait()
        after = os.times()
        used = after.children_user + after.children_system
        return wall, used - before.children_user - before.children_system


def main() -> None:
    """Run the rounds and print a line for each checkout."""
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n")[0], epilog="What `run` is given comes after --."
    )
    parser.add_argument("checkouts", type=Path, nargs="+")
    parser.add_argument("--pairs", type=int, default=5, help="runs of each checkout")
    parser.add_argument("--cold", action="store_true", help="compile the kernels in every run")
    middle = sys.argv.index("--") if "--" in sys.argv else len(sys.argv)
    args = parser.parse_args(sys.argv[1:middle])
    ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    taken: dict[Path, list[tuple[float, float]]] = {path: [] for path in args.checkouts}
    for pair in range(args.pairs + (not args.cold)):
        for path in args.checkouts:
            seconds = run_once(path.resolve(), sys.argv[middle + 1 :], args.cold)
            if args.cold or pair:
                taken[path].append(seconds)
    for path, runs in taken.items():
        cells = [
            f"{median(each):6.2f} s {name} ({min(each):.2f} to {max(each):.2f})"
            for name, each in zip(("wall", "processor"), zip(*runs, strict=True), strict=True)
        ]
        print(f"{path.name:10} {', '.join(cells)}, {args.pairs} runs", flush=True)


if __name__ == "__main__":
    main()
