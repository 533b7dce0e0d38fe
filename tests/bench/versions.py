"""Compare two checkouts: the same command, whole, by turns.

    python tests/bench/versions.py BEFORE AFTER --pairs 5 -- jobs/quickstart.toml --no-figures

Each checkout needs its ``.venv``, which `scripts/test --version` makes. Kernels are compiled before
the first pair, unless `--cold` gives each run an empty cache. Prints wall seconds.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
from pathlib import Path
from statistics import median


def run_once(checkout: Path, words: list[str], cold: bool) -> float:
    """Return the wall seconds of one run into an empty folder."""
    with tempfile.TemporaryDirectory() as scratch:
        cache = {"NUMBA_CACHE_DIR": f"{scratch}/kernels"} if cold else {}
        program = [str(checkout / ".venv/bin/python"), "-P", "-m", "chimera_hpc.sweep", "run"]
        began = time.perf_counter()
        subprocess.run(
            [*program, *words, "--out", f"{scratch}/out"],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": str(checkout), **cache},
            check=True,
            capture_output=True,
        )
        return time.perf_counter() - began


def main() -> None:
    """Run the pairs and print a line for each checkout."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--cold", action="store_true", help="compile the kernels in every run")
    parser.add_argument("words", nargs="+", help="what `run` is given, after --")
    args = parser.parse_args()
    checkouts = {name: getattr(args, name).resolve() for name in ("before", "after")}
    taken: dict[str, list[float]] = {name: [] for name in checkouts}
    for pair in range(args.pairs + (not args.cold)):
        for name, checkout in checkouts.items():
            seconds = run_once(checkout, args.words, args.cold)
            if args.cold or pair:
                taken[name].append(seconds)
    for name, seconds_of in taken.items():
        low, high = min(seconds_of), max(seconds_of)
        print(f"{name:7} {median(seconds_of):6.2f} s ({low:.2f} to {high:.2f}), {args.pairs} runs")


if __name__ == "__main__":
    main()
