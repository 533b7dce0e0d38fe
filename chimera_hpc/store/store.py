"""The store of a sweep: the only record of what is done."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import remove_leftovers
from chimera_hpc.base.status import Status
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.models import model_folder
from chimera_hpc.job.together import points_of
from chimera_hpc.job.user_models import Origin
from chimera_hpc.store.blocks import BlockFiles, Damage
from chimera_hpc.store.check import find_damaged, shallow_damage
from chimera_hpc.store.claims import Claim, remove_stale
from chimera_hpc.store.extend import check_extension, exclusive, extend, repair_metadata
from chimera_hpc.store.ledger import (
    FAILED,
    NO_LIMIT,
    LedgerScan,
    ledger_shape,
    read_block,
    read_copy,
    read_metadata,
    scan_ledger,
    table_columns,
    unfinished,
    with_those_behind,
)
from chimera_hpc.store.read import check_has_run, gather, read_series
from chimera_hpc.store.reduction import StoredReduction, Variable, read_reduction, write_reduction
from chimera_hpc.store.runs import start_run
from chimera_hpc.store.schema import QUALITY, scalar_labels, series_mask
from chimera_hpc.store.strips import StoredSeries
from chimera_hpc.store.template import check_root, consolidate, root_attributes, write_template
from chimera_hpc.store.write import Receipt, write_block

if TYPE_CHECKING:
    from chimera_hpc.store.block_result import BlockResult

_FREE_TABLES = ("name", "title", "decide", "reduction", "run", "slurm")
"""What a job may change between two runs on one store."""


class Store:
    """One sweep's results on disk, block by block; make one with `plan` or `open`.

    A whole block is written at once, the ledger last, so that all results that the ledger reports
    are on the disk. Results are never overwritten: a late or repeated write of a block does not
    change finished rows.
    """

    def __init__(self, path: Path, metadata: Mapping[str, Any], sweep: Sweep) -> None:
        self.path = path
        self.metadata = metadata
        self.sweep = sweep
        self.n_points, self.block_size = ledger_shape(metadata)
        nodes = metadata["consolidated_metadata"]["metadata"]
        self.files = BlockFiles.of(path, sweep, self.block_size, nodes)

    @classmethod
    def plan(cls, path: str | Path, sweep: Sweep) -> Self:
        """Create the store of a sweep, completely or not at all; BadInput when the path exists."""
        write_template(Path(path), sweep)
        return cls.open(path)

    @classmethod
    def open(cls, path: str | Path, origin: Origin | None = None) -> Self:
        """Open a store; BadInput when the path is not one or its attributes are beyond repair.

        The module of a user's model is not imported unless `origin` says where it comes from.
        """
        path = Path(path)
        metadata = read_metadata(path)
        try:
            sweep = check_root(path, metadata, origin)
        except BadInput:
            copy = read_copy(path)
            if copy is None:
                raise
            metadata, sweep = copy, check_root(path, copy, origin)
        return cls(path, metadata, sweep)

    @property
    def n_blocks(self) -> int:
        return -(-self.n_points // self.block_size)

    @property
    def n_state(self) -> int:
        """Values of the array `state` per point; 0 for a sweep without [continue]."""
        return self.files.shapes["state"][1] if "state" in self.files.shapes else 0

    def block(self, i: int) -> tuple[int, int]:
        """Return the first point of block i and the one after its last."""
        if not 0 <= i < self.n_blocks:
            raise IndexError(f"block {i} of {self.n_blocks}")
        return i * self.block_size, min((i + 1) * self.block_size, self.n_points)

    @cached_property
    def sweeps(self) -> tuple[Sweep, ...]:
        """The sweep as it was planned first, then each extension."""
        specs = self.metadata["attributes"]["specs"]
        return tuple(Sweep.from_dict(spec, str(self.path), self.sweep.origin) for spec in specs)

    @cached_property
    def points(self) -> Points:
        """All points, in the order of the store; BadInput when they are not those of the arrays."""
        points = points_of(self.sweeps)
        if len(points) != self.n_points:
            text = f"its specs have {len(points)} points, its arrays {self.n_points}"
            raise BadInput(f"{self.path}: the attributes are damaged: {text}")
        return points

    def block_points(self, i: int) -> Points:
        """Return the points of block i; a process that needs no others does not hold them."""
        first, stop = self.block(i)
        if len(self.sweeps) > 1 or not self.sweep.is_product:
            return self.points[first:stop]
        return self.sweep.stretch(first, stop)

    def check_spec(self, sweep: Sweep) -> None:
        """Raise BadInput, naming the keys that differ, unless the store was made for this sweep.

        A sweep that was extended since is accepted as it was before.
        """
        if sweep.digest not in {known.digest for known in self.sweeps}:
            lines = "; ".join(sweep.explain_difference(self.sweep))
            hint = "; to add its points to this store: extend" if self._is_part_of(sweep) else ""
            raise BadInput(f"{self.path}: holds another sweep: {lines}{hint}")
        if not sweep.keep.fits(self.sweep.keep):
            kept = f"series={self.sweep.keep.series}, dtype={self.sweep.keep.dtype}"
            raise BadInput(f"{self.path}: keep may not change within one store, it has {kept}")

    def _is_part_of(self, sweep: Sweep) -> bool:
        """Tell whether `sweep` would be an extension of the store."""
        try:
            check_extension(self.path, self.sweeps[-1], self.points, sweep)
        except BadInput:
            return False
        return True

    def adopt(self, sweep: Sweep) -> Self:
        """Check the sweep, take over what may change between runs, and return the store."""
        own = self._with_model_of(sweep)
        own.check_spec(sweep)
        changes = {name: getattr(sweep, name) for name in _FREE_TABLES}
        if own.sweep.model_copy(update=changes) == own.sweep and own._knows_the_folder():
            return own
        with exclusive(self.path):
            present = self.open(self.path, own.sweep.origin)
            sweeps = (*present.sweeps[:-1], present.sweep.model_copy(update=changes))
            attributes = root_attributes(sweeps, present.n_points, self.block_size)
            consolidate(self.path, attributes)
        return self.open(self.path, own.sweep.origin)

    def _with_model_of(self, sweep: Sweep) -> Self:
        """Return the store with a user's model as a job has it, from the job's folder first."""
        if not sweep.has_own_code or sweep.model != self.sweep.model:
            return self
        return self.open(self.path, sweep.origin.before(self.sweep.origin))

    def _knows_the_folder(self) -> bool:
        known: str | None = self.metadata["attributes"].get("model_folder")
        return model_folder(self.sweep) == known

    def extend(self, sweep: Sweep) -> Self:
        """Add the points of `sweep` that are not in the store, behind the others; return the store.

        Finished points are not touched. `sweep` must hold all points of the store and differ in its
        axes only; else BadInput. An extension that is killed half-way has no effect and can be
        repeated.
        """
        origin = self._with_model_of(sweep).sweep.origin
        with exclusive(self.path):
            present = self.open(self.path, origin)
            repair_metadata(self.path, present.metadata, present.sweep, present.points)
            if sweep.keep.fits(present.sweep.keep):
                sweep = sweep.model_copy(update={"keep": present.sweep.keep})
            extend(self.path, present.sweeps, sweep, self.block_size)
        return self.open(self.path, origin)

    # What is done, and what is to do

    def scan(self) -> LedgerScan:
        """Read the ledger and say which of its chunks are damaged."""
        return scan_ledger(self.path, self.metadata)

    def ledger(self) -> dict[str, NDArray[np.int64]]:
        """Return the ledger's columns, one entry per point; status 255 where a point never ran."""
        return self.scan().columns

    def status(self) -> dict[Status, int]:
        """Count the points by outcome."""
        codes = self.ledger()["status"]
        return {status: int(np.count_nonzero(codes == status)) for status in Status}

    def pending(
        self,
        retry_failed: bool = False,
        *,
        attempts: int | None = None,
        statuses: Collection[Status] = FAILED,
        before: int = NO_LIMIT,
    ) -> list[int]:
        """Return the blocks that have something to do: points that never ran, or damaged chunks.

        With `retry_failed` also those with failed points, if `attempts` is given only with points
        that were tried fewer times; `statuses` and `before` (see `ledger.unfinished`) limit which
        failures count.
        """
        scan = self.scan()
        limit = (NO_LIMIT if attempts is None else attempts) if retry_failed else 0
        to_do = np.flatnonzero(unfinished(scan.columns, limit, statuses, before)) // self.block_size
        damaged = {damage.block for damage in find_damaged(self.files, scan)}
        return sorted({*np.unique(to_do).tolist(), *damaged})

    def points_to_do(
        self,
        i: int,
        attempts: int = 0,
        statuses: Collection[Status] = FAILED,
        before: int = NO_LIMIT,
    ) -> NDArray[np.int64]:
        """Return which points of block i, counted within it, are to be run.

        These are the points that never ran, those that failed fewer than `attempts` times (see
        `ledger.unfinished`), and all of them when a chunk of the block is damaged.
        """
        start, stop = self.block(i)
        table = read_block(self.path, i, self.block_size)
        if table is None or shallow_damage(self.files, i):
            return np.arange(stop - start)
        columns = table_columns(table[: stop - start])
        to_do = unfinished(columns, attempts, statuses, before)
        return np.flatnonzero(with_those_behind(to_do, columns["status"], self.block_size))

    def find_damaged(self, deep: bool = False, patience: float = 0.0) -> list[Damage]:
        """Return the damaged chunks, by presence and length or, if `deep`, decoding every byte.

        Missing files are looked for again until `patience` seconds are over: network file systems
        show new files late.
        """
        return find_damaged(self.files, self.scan(), deep=deep, patience=patience)

    def discard_block(self, i: int) -> None:
        """Forget that block i was ever run; its chunks stay until they are written again."""
        self.files.file("ledger", i).unlink(missing_ok=True)

    def repair(self) -> list[str]:
        """Repair what any process can repair, and return a line for each repair.

        Damaged metadata and coordinates are rewritten; the temporary files of processes that
        are gone are removed, and their claims on finished blocks. Damaged blocks are not touched:
        `pending` lists them.
        """
        folders = [child for child in self.path.iterdir() if child.is_dir()]
        count = sum(remove_leftovers(folder) for folder in (self.path, *folders))
        done = [f"{count} temporary files removed"] if count else []
        finished = set(range(self.n_blocks)) - set(self.pending())
        stale = remove_stale(self.path, finished)
        done += [f"{stale} claims on finished blocks removed"] if stale else []
        with exclusive(self.path):
            present = self.open(self.path)
            return done + repair_metadata(
                self.path, present.metadata, present.sweep, present.points
            )

    # Writing

    def start_run(self, info: Mapping[str, Any]) -> int:
        """Record a run (see `store.provenance`) and return its number for the ledger."""
        return start_run(self.path, info)

    def write_block(
        self,
        i: int,
        result: BlockResult,
        run: int,
        attempts: int,
        claim: Claim | None = None,
        rows: Sequence[int] | NDArray[np.int64] | None = None,
    ) -> Receipt:
        """Write a block, or only some of its points, and return the receipt.

        result: results of the points in `rows`, in their order; status 255 means not run.
        attempts: tries of these points since the block was last written, added to the ledger's.
        claim: the right to write the block; ClaimLost is raised when another owner has it by now.
        rows: points counted within the block; all of them when not given.
        """
        start, stop = self.block(i)
        where = range(stop - start) if rows is None else rows
        return write_block(self.files, i, result, run, attempts, where, claim)

    # Reading

    def features(self) -> NDArray[np.float64]:
        """Return the features, shape (n_points, 8, n_observed); NaN where a point never ran.

        NaN, too, beyond the links or triangles that a point has, if another one has more.

        Raises DamagedChunk rather than give NaN for what was there.
        """
        return gather(self.files, "features", self.scan())

    def scalars(self) -> dict[str, NDArray[np.float64]]:
        """Return each quantity over all points by its name; NaN where a point never ran."""
        table = gather(self.files, "scalars", self.scan())
        labels = scalar_labels(self.sweep)
        return {label: table[:, k] for k, label in enumerate(labels)}

    def quality(self) -> dict[str, NDArray[np.float64]]:
        """Return each mark of `QUALITY` over all points by its name.

        NaN where a point has no result, and throughout a store that a version before 0.2 planned.
        """
        if "quality" not in self.files.shapes:
            return {label: np.full(self.n_points, np.nan) for label in QUALITY}
        table = gather(self.files, "quality", self.scan())
        return {label: table[:, k] for k, label in enumerate(QUALITY)}

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """How many nodes, links or triangles with a signal each point has, shape (n_points,)."""
        return self.sweep.observed(self.points)

    def size(self, i: int) -> int:
        """Return how many nodes, links or triangles with a signal point i has."""
        return self.sweep.n_nodes if self.sweep.signals == "nodes" else int(self.sizes[i])

    def series(self, i: int) -> NDArray[np.float64]:
        """Return u of point i over the analysis interval, shape (times, nodes).

        Raises BadInput when the series of the point is not kept, or it never ran.
        """
        i = range(self.n_points)[i]
        self._check_series(i)
        return read_series(self.files, i)[:, : self.size(i)]

    def node_series(self, i: int) -> StoredSeries:
        """Return u of point i node by node, read from the disk as it is asked for.

        Raises BadInput as `series`, and DamagedChunk.
        """
        i = range(self.n_points)[i]
        self._check_series(i)
        check_has_run(self.files, i)
        return StoredSeries(self.files, i, self.size(i))

    def _check_series(self, i: int) -> None:
        if not series_mask(self.sweep, self.points.columns["seed"][i : i + 1]).all():
            raise BadInput(f"{self.path}: the series of point {i} is not kept")

    def starts(self, chosen: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Return the states that points start from, shape (len(chosen), variables).

        NaN for the first point of a chain, which has its own initial state, and after a point
        without a state. None for a sweep without [continue]. Raises DamagedChunk.
        """
        if not self.n_state:
            return None
        found = np.full((len(chosen), self.n_state), np.nan)
        for row, (block, place) in enumerate(divmod(int(i), self.block_size) for i in chosen):
            if place and read_block(self.path, block, self.block_size) is not None:
                found[row] = self.files.read("state", block)[place - 1]
        return found

    # Reduction

    def reduction(self) -> StoredReduction:
        """Return what the last reduction stored; BadInput when there is none."""
        return read_reduction(self.path)

    def write_reduction(
        self, variables: Mapping[str, Variable], attributes: Mapping[str, Any]
    ) -> None:
        """Replace the group `reduction`: ``name: (dimensions, values[, attributes])``, attributes.

        No strings as values: Zarr v3 has no settled type for them; put them into attributes.
        """
        with exclusive(self.path):
            write_reduction(self.path, variables, attributes)
            consolidate(self.path)

    def consolidate(self) -> None:
        """Gather the metadata of the reduction in the root, as `write_reduction` does."""
        with exclusive(self.path):
            consolidate(self.path)
