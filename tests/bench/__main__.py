"""Performance, ours and the peers', in one run.

``scripts/bench`` prints the table; ``--write`` puts it into docs/ with its picture; ``--only`` runs
some of the parts; ``--tiny`` is for the tests: everything runs, no number means anything.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import measure
import networks
import page
import precision
import single
import sweeps
from page import Results
from projection import Costs, Forecast, forecast
from single import Row, Sizes

ROOT = Path(__file__).parents[2]
PARTS = (
    "peers",
    "steps",
    "features",
    "networked",
    "networks",
    "precision",
    "sweeps",
    "starting",
    "reduction",
    "projection",
)
_PIECES = 800
"""Pieces of dgemm that are about half as long as the bare blocks of the plane."""
_REPEATS = {1: 2, 2: 3}
"""How often a whole command is compared with its bare blocks, by its workers: each time comes out
another way by some percent, those that last longer by less."""
TINY = Sizes((4,), 2.0, 1.0, 1, 0.0, 1, (50, 100), 40, False)


def main() -> int:
    """Measure what was asked for and print the table."""
    args = _arguments()
    sizes = Sizes(repeats=args.repeats)
    if args.tiny:
        sizes = TINY
    results = Results(measure.machine(), os.getloadavg()[0])
    print(results.machine, f"load {results.load:.1f}", flush=True)
    with sweeps.scratch(args.folder) as folder:
        for part in args.only:
            rows = _part(part, sizes, folder, results, args.tiny)
            results.rows += rows
            for row in rows:
                print("  ".join(row.words()), flush=True)
    for name, found in results.forecasts:
        print(name, found)
    for size in results.sizes:
        print(size)
    if args.json:
        args.json.write_text(json.dumps([asdict(row) for row in results.rows], indent=1))
    if args.write:
        page.write(results, args.docs)
    return 0


def _part(part: str, sizes: Sizes, folder: Path, results: Results, tiny: bool) -> list[Row]:
    if part in ("peers", "steps", "features", "networked", "networks", "precision"):
        cores = os.sched_getaffinity(0)
        measure.stay_on_one_core()
        try:
            return _single(part, sizes, results, tiny)
        finally:
            os.sched_setaffinity(0, cores)
    if part == "sweeps":
        settings = ["P=3:4", "seeds=1", "integrator.t_end=20", "features.start=10"] if tiny else []
        seeds = (1,) if tiny else (1, 5)
        pieces = 2 if tiny else _PIECES
        repeats = {1: 1, 2: 1} if tiny else _REPEATS
        rows = sweeps.workers(folder, settings, seeds, pieces, repeats, results.scaling)
        return rows + sweeps.memory(folder, (55.0, 60.0) if tiny else (1000.0, 10_000.0))
    if part == "starting":
        return sweeps.starting(folder, 1 if tiny else 3, cold=not tiny)
    if part == "reduction":
        return _reduction(folder, results, tiny)
    return _projection(folder, results, tiny)


def _single(part: str, sizes: Sizes, results: Results, tiny: bool) -> list[Row]:
    if part == "peers":
        return single.against_peers(sizes)
    if part == "steps":
        return single.stepping(sizes, results.scaling)
    if part == "features":
        return single.features(sizes)
    if part == "networked":
        return single.networked(sizes)
    if part == "networks":
        return networks.against_peers(sizes)
    tolerances = (1e-3,) if tiny else (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    results.precision = precision.curves(tolerances, 1 if tiny else 3, sizes.with_jax)
    return []


def _reduction(folder: Path, results: Results, tiny: bool) -> list[Row]:
    from reduction import sizes as at_sizes

    from chimera_hpc.base.status import Status
    from chimera_hpc.reduction.results import TRIPLET
    from chimera_hpc.store.store import Store

    store = folder / "plane" / "store.zarr"
    source = np.random.default_rng(1).random((500, 3))
    if store.exists() and not tiny:
        opened = Store.open(store)
        scalars, done = opened.scalars(), opened.ledger()["status"] == Status.DONE
        source = np.stack([scalars[name][done] for name in TRIPLET], axis=1)
    points, leaves = (
        ((200,), (100, 200)) if tiny else ((6_380, 50_000, 1_000_000), (2_000, 10_000, 50_000))
    )
    results.sizes = at_sizes(source, points, leaves)
    return []


def _projection(folder: Path, results: Results, tiny: bool) -> list[Row]:
    costs = results.costs = _costs(folder, tiny)
    cores, points = (10, 1000) if tiny else (10_000, 10_000_000)
    plans: list[tuple[str, int, int, int, bool]] = []
    for block in (300, 3000):
        plans += [
            ("scheduler", n, points, block, True) for n in (cores // 100, cores // 10, cores) if n
        ]
        plans += [("job array", cores, points, block, False)]
    results.forecasts = [(name, _forecast(costs, *plan)) for name, *plan in plans]
    return []


def _forecast(costs: Costs, cores: int, points: int, block: int, scheduler: bool) -> Forecast:
    return forecast(costs, cores, points, block, scheduler)


def _costs(folder: Path, tiny: bool) -> Costs:
    import overheads

    return overheads.measure_costs(folder, 20_000 if tiny else 100_000, tiny)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__.splitlines()[0])
    parser.add_argument("--only", type=_parts, default=PARTS, metavar="PART,...",
                        help=f"some of {', '.join(PARTS)}")  # fmt: skip
    parser.add_argument("--repeats", type=int, default=5, help="interleaved repeats (default: 5)")
    parser.add_argument("--write", action="store_true", help="write docs/performance.md")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the table here too")
    parser.add_argument("--folder", type=Path, help="where to work (default: a temporary folder)")
    parser.add_argument("--tiny", action="store_true", help="smallest sizes, to see that all runs")
    return parser.parse_args()


def _parts(words: str) -> tuple[str, ...]:
    parts = tuple(words.split(","))
    for part in parts:
        if part not in PARTS:
            raise argparse.ArgumentTypeError(f"{part!r}; allowed: {', '.join(PARTS)}")
    return parts


if __name__ == "__main__":
    sys.exit(main())
