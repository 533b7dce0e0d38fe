"""``verify``: are the bytes on the disk what was written, and would they come out again?"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import add, flag, store_path, value
from chimera_hpc.cli.ending import MOST_LINES, name_of
from chimera_hpc.store.claims import claim_block
from chimera_hpc.store.ledger import digests

if TYPE_CHECKING:
    from chimera_hpc.job import Points
    from chimera_hpc.store.blocks import Damage
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep verify results/quickstart --stored
  python -m chimera_hpc.sweep verify results/quickstart --stored --forget
  python -m chimera_hpc.sweep verify results/quickstart --sample 0.01

--stored decodes every chunk and recomputes every digest from the stored bytes; --sample computes
this share of the points again, at least one, compares digests, and says what differs in code,
libraries or processor between the runs that made these points and now. Without either: both, with a
sample of 0.01. Exit status 1: stored data is damaged, or a recomputed point differs. After
--forget, `run` computes damaged blocks again.
"""
_SAMPLE = 0.01


def add_arguments(parser: ArgumentParser) -> None:
    add(
        parser,
        "folder",
        stored=flag("decode every stored chunk"),
        forget=flag("forget damaged blocks: `run` computes them again"),
        sample=value("SHARE", float, "share of points, 0 to 1"),
        seed=value("N", int, "chooses the sample", default=0),
    )


def execute(args: Namespace) -> int:
    if args.sample is not None and not 0 <= args.sample <= 1:
        raise BadInput(f"--sample {args.sample}: a share from 0 to 1 is needed")
    if args.seed < 0:
        raise BadInput(f"--seed {args.seed}: must not be below 0")
    path = store_path(args.folder)
    from chimera_hpc.store.store import Store

    store = Store.open(path)
    both = not args.stored and args.sample is None
    good = True
    if args.stored or args.forget or both:
        good = _verify_stored(store, args.forget)
    if args.sample is not None or both:
        share = _SAMPLE if args.sample is None else args.sample
        good = _verify_sample(store, share, args.seed) and good
    return Exit.COMPLETE if good else Exit.FAILURES


def _verify_stored(store: Store, forget: bool) -> bool:
    damage = store.find_damaged(deep=True)
    written = int(np.count_nonzero(store.scan().written))
    print(f"stored: {written} blocks decoded, {len(damage)} chunks damaged")
    for line in damage[:MOST_LINES]:
        print(f"  {line}")
    if len(damage) > MOST_LINES:
        print(f"  and {len(damage) - MOST_LINES} more")
    if damage and forget:
        _forget(store, damage)
    elif damage:
        print("  verify --forget, then run, computes these blocks again")
    return not damage


def _forget(store: Store, damage: list[Damage]) -> None:
    forgotten = 0
    for block in sorted({d.block for d in damage}):
        claim = claim_block(store.path, block, run=0)
        if claim is None:
            print(f"  block {block} is in work: left as it is")
            continue
        store.discard_block(block)
        claim.release()
        forgotten += 1
    print(f"  {forgotten} blocks forgotten; run computes them again")


def _verify_sample(store: Store, share: float, seed: int) -> bool:
    ledger = store.ledger()
    results = np.flatnonzero((ledger["status"] >= 1) & (ledger["status"] <= 3))
    count = min(len(results), max(1, round(share * len(results)))) if share > 0 else 0
    chosen = np.sort(np.random.default_rng(seed).choice(results, count, replace=False))
    different = [i for part in _parts(store, chosen) for i in _different(store, ledger, part)]
    print(f"sample: {count} of {len(results)} points recomputed, {len(different)} different")
    for i, size in different[:MOST_LINES]:
        print(f"  {name_of(store, i)}: largest difference of a feature or scalar {size:.3g}")
    wrong = [i for i, _ in different]
    for line in _what_differs(store, ledger["run"][wrong or chosen], bool(different)):
        print(f"  {line}")
    return not different


def _parts(store: Store, chosen: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cut the chosen points as a run would, so that the memory needed is that of a run."""
    size = store.block_size
    return [chosen[i : i + size] for i in range(0, len(chosen), size)]


def _different(
    store: Store, ledger: dict[str, NDArray[np.int64]], chosen: NDArray[np.int64]
) -> list[tuple[int, float]]:
    """Return the points that come out otherwise, and by how much."""
    from chimera_hpc.run.block import run_block

    points: Points = store.points[chosen]
    made = run_block(store.sweep, points, starts=store.starts(chosen))
    found = digests(made.features, made.scalars)
    wrong = np.flatnonzero(found != ledger["digest"][chosen])
    different = []
    for k in wrong.tolist():
        block, row = divmod(int(chosen[k]), store.block_size)
        pairs: list[tuple[NDArray[Any], NDArray[Any]]] = [
            (made.features[k], store.files.read("features", block)[row]),
            (made.scalars[k], store.files.read("scalars", block)[row]),
        ]
        sizes = [np.abs(new - old) for new, old in pairs]
        sizes = [size[np.isfinite(size)].max(initial=0.0) for size in sizes]
        different.append((int(chosen[k]), float(max(sizes))))
    return different


def _what_differs(store: Store, runs: NDArray[np.int64], wanted: bool) -> list[str]:
    """Return what differs between these runs and now; if it is `wanted`, a line where nothing does.

    It is said of points that came out the same, too.
    """
    from chimera_hpc.store.provenance import differences, gather
    from chimera_hpc.store.runs import read_run

    lines = []
    now = gather(store.sweep)
    for run in np.unique(runs).tolist():
        try:
            found = differences(read_run(store.path, run), now)
        except BadInput as error:
            found = [str(error)]
        if wanted and not found:
            found = ["nothing known of differs: a fault of the machine?"]
        lines += [f"run {run}: {line}" for line in found]
    return lines
