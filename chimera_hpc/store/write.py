"""Writes a block: data first, the ledger last, finished rows unchanged."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import BlockFiles, DamagedChunk
from chimera_hpc.store.claims import Claim, ClaimLost
from chimera_hpc.store.ledger import (
    FIELDS,
    RESULTS,
    canonical,
    read_block,
    stored_digests,
    table_columns,
)

if TYPE_CHECKING:
    from chimera_hpc.store.block_result import BlockResult

Rows = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Receipt:
    """What the write of a block did: small enough to go through a scheduler by the thousand."""

    block: int
    n_done: int
    """Points written that have a result."""
    n_failed: int
    """Points written that failed."""
    bytes: int
    seconds: float
    """Time of writing."""


def write_block(
    files: BlockFiles,
    block: int,
    result: BlockResult,
    run: int,
    attempts: int,
    rows: Sequence[int] | NDArray[np.int64],
    claim: Claim | None = None,
) -> Receipt:
    """Write the results of the points `rows` of a block; see `Store.write_block`."""
    began = time.perf_counter()
    _confirm(claim)
    where = np.asarray(rows, dtype=np.int64)
    if len(where) != len(result.status):
        raise ValueError(f"{len(result.status)} results for {len(where)} points of block {block}")
    chunks, tried = _stored(files, block)
    ran = np.asarray(result.status) != Status.NEVER
    take = ran & ~_has_result(chunks["ledger"][where])
    if not take.any():
        return Receipt(block, 0, 0, 0, time.perf_counter() - began)
    new = _rows(result, run, tried[where] + attempts)
    for name, chunk in chunks.items():
        if name in new:
            chunk[where[take]] = new[name][take]
    ledger = {"ledger": chunks.pop("ledger")}
    size = files.write(block, chunks)
    _confirm(claim)
    size += files.write(block, ledger)
    n_done = int(np.count_nonzero(_has_result(new["ledger"][take])))
    n_failed = int(np.count_nonzero(take)) - n_done
    return Receipt(block, n_done, n_failed, size, time.perf_counter() - began)


def _confirm(claim: Claim | None) -> None:
    if claim is not None and not claim.still_mine():
        raise ClaimLost(f"block {claim.block} was taken over by another process")


def _stored(files: BlockFiles, block: int) -> tuple[Rows, NDArray[np.int64]]:
    """Return the undamaged chunks of a block, and how often each point was tried."""
    ledger = read_block(files.path, block, files.shapes["ledger"][0])
    if ledger is not None:
        tried = table_columns(ledger)["attempts"]
        try:
            return {name: files.read(name, block).copy() for name in files.shapes}, tried
        except DamagedChunk:
            # Nothing of a damaged block is kept: all of its points are done again.
            return {name: files.empty(name) for name in files.shapes}, tried
    chunks = {name: files.empty(name) for name in files.shapes}
    return chunks, np.zeros(len(chunks["ledger"]), dtype=np.int64)


def _rows(result: BlockResult, run: int, attempts: NDArray[np.int64]) -> Rows:
    """Return the result as rows of each array."""
    features, scalars = canonical(result.features), canonical(result.scalars)
    fields = {
        "status": result.status,
        "attempts": attempts,
        "steps": result.steps,
        "elapsed_us": result.elapsed_us,
        "n_windows": result.n_windows,
        "run": np.full(len(attempts), run),
        "digest": stored_digests(features, scalars),
    }
    ledger = np.stack([fields[name] for name in FIELDS], axis=1).astype("<i8")
    rows: Rows = {"features": features, "scalars": scalars, "ledger": ledger}
    rows["quality"] = canonical(result.quality)
    if result.series is not None:
        rows["u"] = result.series
    state = getattr(result, "state", None)
    if state is not None:
        rows["state"] = canonical(state)
    return rows


def _has_result(ledger: NDArray[np.int64]) -> NDArray[np.bool_]:
    return np.isin(ledger[:, FIELDS.index("status")], [int(status) for status in RESULTS])
