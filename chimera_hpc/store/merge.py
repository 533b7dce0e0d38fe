"""Merges several stores into one: their points, results and records of runs."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import write_atomically
from chimera_hpc.base.status import Status
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.chains import followed
from chimera_hpc.job.points import point_keys
from chimera_hpc.job.together import points_of
from chimera_hpc.store.blocks import BlockFiles
from chimera_hpc.store.extend import SAME_TABLES
from chimera_hpc.store.ledger import FIELDS, read_metadata
from chimera_hpc.store.runs import FOLDER as RUNS
from chimera_hpc.store.runs import read_run, read_work, record_work, run_numbers
from chimera_hpc.store.template import build, create_whole

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

_RUN = FIELDS.index("run")


@dataclass(frozen=True)
class Merged:
    """What a merge found."""

    n_points: int
    taken: tuple[int, ...]
    """Points taken from each store, in the order in which they were given."""
    conflicts: NDArray[np.int64]
    """Points, numbered as in the new store, for which two stores have different results."""


def merge(path: Path, stores: Sequence[Store]) -> Merged:
    """Create at `path` a store of all points of `stores`, completely or not at all.

    A point that is in several stores is taken from the first one that has a result for it, else
    from the first that tried it. Runs are renumbered, store after store.

    Raises BadInput when the path exists or cannot be written, or the sweeps differ in more than
    their axes.
    Raises DamagedChunk when a chunk of one of the stores is damaged.
    """
    for other in stores[1:]:
        _check_alike(stores[0], other)
    sweeps = _all_sweeps(stores)
    points = points_of(sweeps)
    work = _Merge(stores, points)

    def make(temporary: Path) -> None:
        build(temporary, sweeps, points, stores[0].block_size)
        work.copy_runs(temporary)
        work.copy_blocks(temporary, sweeps[-1])

    create_whole(path, make)
    taken = tuple(int(np.count_nonzero(work.source == k)) for k in range(len(stores)))
    return Merged(len(points), taken, np.flatnonzero(work.conflict))


class _Merge:
    """Which store each point comes from, and the copying."""

    def __init__(self, stores: Sequence[Store], points: Points) -> None:
        self.stores = stores
        self.ledgers = [store.ledger() for store in stores]
        self.place = [_places(store.points, points) for store in stores]
        self.first_run = np.cumsum([0] + [max(run_numbers(s.path), default=0) for s in stores])
        self.source = np.full(len(points), -1)
        self.conflict = np.zeros(len(points), dtype=np.bool_)
        self._choose()
        self._chunk = lru_cache(maxsize=4 * len(stores) * 2)(self._read)

    def _choose(self) -> None:
        """Fill `source`, the number of a store or -1, and `conflict`."""
        digest = np.zeros(len(self.source), dtype=np.int64)
        has_result = np.zeros(len(self.source), dtype=np.bool_)
        for k, (ledger, place) in enumerate(zip(self.ledgers, self.place, strict=True)):
            here = place >= 0
            status = np.where(here, ledger["status"][place], Status.NEVER)
            found = np.where(here, ledger["digest"][place], 0)
            result = (status >= Status.DONE) & (status <= Status.NO_WINDOW)
            self.conflict |= result & has_result & (found != digest)
            take = result & ~has_result
            self.source[take] = k
            digest[take] = found[take]
            has_result |= result
            self.source[(self.source < 0) & (status != Status.NEVER)] = k

    def copy_runs(self, path: Path) -> None:
        (path / RUNS).mkdir(exist_ok=True)
        for store, first in zip(self.stores, self.first_run, strict=False):
            for number in run_numbers(store.path):
                info: dict[str, Any] = {"merged from": {"store": str(store.path), "run": number}}
                info = {"run": int(first) + number} | info
                try:
                    info = read_run(store.path, number) | info
                except BadInput:
                    info["record"] = "unreadable"
                data = json.dumps(info, indent=1).encode()
                write_atomically(path / RUNS / f"{info['run']}.json", data)
                if work := read_work(store.path, number):
                    record_work(path, info["run"], work)

    def copy_blocks(self, path: Path, sweep: Sweep) -> None:
        size = self.stores[0].block_size
        nodes = read_metadata(path)["consolidated_metadata"]["metadata"]
        files = BlockFiles.of(path, sweep, size, nodes)
        for block in range(-(-len(self.source) // size)):
            source = self.source[block * size : (block + 1) * size]
            if (source >= 0).any():
                files.write(block, self._block(files, block * size, source))
                # A sign of life: a folder that stands still for an hour counts as left over.
                os.utime(path)

    def _block(
        self, files: BlockFiles, start: int, source: NDArray[np.int64]
    ) -> dict[str, NDArray[Any]]:
        chunks = {name: files.empty(name) for name in files.shapes}
        for row in np.flatnonzero(source >= 0).tolist():
            k = int(source[row])
            block, old = divmod(int(self.place[k][start + row]), self.stores[k].block_size)
            for name in self.stores[k].files.shapes:
                chunks[name][row] = self._chunk(k, name, block)[old]
            chunks["ledger"][row, _RUN] += self.first_run[k]
        return chunks

    def _read(self, k: int, name: str, block: int) -> NDArray[Any]:
        return self.stores[k].files.read(name, block)


def _check_alike(first: Store, other: Store) -> None:
    differ = [
        t.rstrip("_") for t in SAME_TABLES if getattr(first.sweep, t) != getattr(other.sweep, t)
    ]
    if first.sweep.n_nodes != other.sweep.n_nodes:
        differ.append("fixed.n_nodes")
    elif first.sweep.n_observed != other.sweep.n_observed:
        differ.append(f"the largest number of {first.sweep.signals}")
    elif followed(first.sweep) != followed(other.sweep):
        differ.append("the axis of the chains")
    elif first.n_state != other.n_state:
        differ.append("the largest number of variables")
    if differ:
        raise BadInput(
            f"{other.path}: differs from {first.path} in {', '.join(differ)}; "
            "only sweeps that differ in their axes can be merged"
        )


def _all_sweeps(stores: Sequence[Store]) -> list[Sweep]:
    """Return the sweeps of all stores, each once; the last one has the lowest first seed.

    With ``keep.series = "first-seed"`` the last one says which series are to be found.
    """
    sweeps = {sweep.digest: sweep for store in stores for sweep in store.sweeps}
    return sorted(sweeps.values(), key=lambda sweep: -sweep.seeds[0])


def _places(points: Points, among: Points) -> NDArray[np.int64]:
    """Return where each of the points `among` stands in `points`, -1 where it does not."""
    keys, wanted = point_keys(points, among), point_keys(among)
    order = np.argsort(keys)
    rank = np.searchsorted(keys, wanted, sorter=order)
    place = order[np.minimum(rank, len(order) - 1)]
    return np.where(keys[place] == wanted, place, -1)
