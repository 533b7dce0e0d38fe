"""`chimera_hpc.open`: the classes of the last reduction beside the results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from store_tools import block_results, make_store

import chimera_hpc
from chimera_hpc.base.status import Status
from chimera_hpc.store.store import Store

NAMES = ["ordered", "chimera", "steady", "no_window"]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return make_store(tmp_path)


def reduction(store: Store, labels: list[int], modal: list[int]) -> tuple[Any, Any]:
    """What a reduction to two classes stores, as far as it is read here."""
    variables = {
        "labels_2": (("point",), np.array(labels)),
        "modal_class_2": (("cell_number",), np.array(modal)),
        "cell": (("point",), store.points.cells()[0]),
    }
    return variables, {"cuts": [2], "names_2": NAMES}


@pytest.fixture
def classified(store: Store) -> Store:
    """15 points in three cells of five, all run but for the last block; one of them steady."""
    for block in range(store.n_blocks - 1):
        result = block_results(store, block)
        if block == 0:
            result.status[1] = Status.STEADY
        store.write_block(block, result, 1, 1)
    store.write_reduction(
        *reduction(store, [0, -1, 0, 0, 1, 1, 1, 1, 0, 0, 1, 1, -1, -1, -1], [0, 1, -1])
    )
    return store


def test_runs_and_cells_carry_their_classes(classified):
    with chimera_hpc.open(classified.path) as data:
        assert data.class_2.values[:6].tolist() == [
            *("ordered", "steady", "ordered", "ordered", "chimera", "chimera")
        ]
        assert data.class_2.values[12:].tolist() == ["", "", ""]
        assert data.modal_class_2.values.tolist() == ["ordered"] * 5 + ["chimera"] * 5 + [""] * 5
        assert data.class_2.attrs == {"long_name": "class of the run, 2 clusters"}


def test_a_store_that_was_not_reduced_has_no_classes(store):
    with chimera_hpc.open(store.path) as data:
        assert not [name for name in data if str(name).startswith(("class", "modal"))]


def test_classes_older_than_the_points_are_left_out(store):
    store.write_reduction(*reduction(store, [0] * 14, [0, 0, 0]))
    with chimera_hpc.open(store.path) as data:
        assert "class_2" not in data
        assert data.sizes["point"] == 15


def test_selecting_and_unstacking_the_whole_dataset_reads_no_series(classified: Store) -> None:
    for chunk in (classified.path / "u").glob("c.*"):
        chunk.write_bytes(b"no chunk: decoding it fails")
    with chimera_hpc.open(classified.path) as data:
        grid = data.set_index(point=["cell", "seed"]).unstack()
        assert grid.V_theta.dims == ("cell", "seed")
        assert np.isfinite(grid.amplitude.isel(cell=0).values).all()
        chimeras = data.where(data.class_2 == "chimera", drop=True)
        assert chimeras.seed.dtype == np.int64
        assert chimeras.sizes["point"] == 6
        with pytest.raises(Exception, match=r"."):
            _ = grid.u.isel(cell=0, seed=0).values
