"""Sweeps with made-up results for reports: finished, unfinished, with failures, of several axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from store_tools import block_results, make_store

from chimera_hpc.base.status import Status
from chimera_hpc.store.store import Store

CENTRES = ((0.05, 0.01, 0.001), (0.3, 0.1, 0.11), (0.55, 0.02, 0.01))
"""Variations of ordered, chimera and disordered runs; the class of a cell is P modulo 3."""
CLASSES = ("ordered", "chimera", "disordered")

Fill = Callable[..., Store]


def fill(
    folder: Path,
    *overrides: str,
    blocks: Sequence[int] | None = None,
    failed: Sequence[int] = (),
    steady: Sequence[int] = (),
) -> Store:
    """Fill the small store; `failed` and `steady` are points. Steady ones may have a triplet."""
    store = make_store(folder, *overrides)
    store.start_run({"package": {"name": "chimera_hpc", "version": "0"}, "started": "today"})
    columns = store.points.columns
    for block in range(store.n_blocks) if blocks is None else blocks:
        made = block_results(store, block)
        for row, point in enumerate(range(*store.block(block))):
            centre = CENTRES[int(columns["P"][point]) % 3]
            spread = 1.0 + 0.01 * columns["seed"][point] + 0.003 * columns["Q"][point]
            made.scalars[row, :3] = np.multiply(centre, spread)
            made.features[row, 1] = 2.0
            if point in failed or point in steady:
                made.status[row] = Status.TIME_OUT if point in failed else Status.STEADY
                made.features[row] = made.scalars[row, :3] = np.nan
            if point in steady and store.sweep.features.steady == "level":
                made.scalars[row, :3] = 0.0, 0.03, 0.0
        store.write_block(block, made, 1, 1)
    return store


@pytest.fixture(scope="session")
def filled() -> Fill:
    """The function that makes such a store in a folder."""
    return fill
