"""Reading results over all points, checksums verified."""

from __future__ import annotations

import numpy as np
import zarr
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import BlockFiles, Damage, DamagedChunk
from chimera_hpc.store.ledger import LedgerScan, read_block, table_columns
from chimera_hpc.store.schema import decode_series


def gather(files: BlockFiles, name: str, scan: LedgerScan) -> NDArray[np.float64]:
    """Return `features`, `scalars` or `quality` over all points; NaN where a point never ran.

    Raises DamagedChunk rather than give NaN for what was there.
    """
    status = scan.columns["status"]
    shape = files.shapes[name]
    table = np.full((len(status), *shape[1:]), np.nan)
    for block in np.flatnonzero(scan.written).tolist():
        rows = table[block * shape[0] : (block + 1) * shape[0]]
        rows[:] = files.read(name, block)[: len(rows)]
    table[status == Status.NEVER] = np.nan
    return table


def read_series(files: BlockFiles, point: int) -> NDArray[np.float64]:
    """Return u of one point, shape (times, nodes), NaN where a sample is missing."""
    check_has_run(files, point)
    block, row = divmod(point, files.shapes["u"][0])
    damage = files.look("u", block)
    if damage:
        raise DamagedChunk(damage)
    try:
        array = zarr.open_array(files.path / "u", mode="r")
        return decode_series(np.asarray(array[point]))
    except Exception as error:
        # Each codec has its own way to say that bytes are not what it wrote.
        reason = f"point {row} of it cannot be decoded ({type(error).__name__})"
        raise DamagedChunk(Damage(block, "u", reason)) from error


def check_has_run(files: BlockFiles, point: int) -> None:
    """Raise BadInput where a point never ran."""
    block, row = divmod(point, files.shapes["u"][0])
    ledger = read_block(files.path, block, files.shapes["ledger"][0])
    if ledger is None or table_columns(ledger)["status"][row] == Status.NEVER:
        raise BadInput(f"{files.path}: point {point} has not been run")
