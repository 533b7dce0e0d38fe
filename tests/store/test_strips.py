"""Some nodes of a stored series, without the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from store_tools import encode_series, results, small_sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import DamagedChunk
from chimera_hpc.store.store import Store


def store_of(path: Path, u: np.ndarray, *overrides: str) -> Store:
    """Return a store whose first point has this series (T, N)."""
    store = Store.plan(
        path / "store.zarr",
        small_sweep(f"n_nodes={u.shape[1]}", f"integrator.t_end={9.5 + 0.5 * len(u)}", *overrides),
    )
    made = results(store, range(4))
    made.series[0] = encode_series(u, store.sweep.keep.dtype)
    store.write_block(0, made, store.start_run({}), 1)
    return store


@pytest.mark.parametrize("dtype", ["int16", "float32"])
@pytest.mark.parametrize("kind", ["smooth", "noise", "missing"])
def test_nodes_are_those_of_the_whole_series(tmp_path: Path, dtype: str, kind: str) -> None:
    u = np.sin(0.1 * np.arange(2001.0)[:, None] + np.arange(150))
    if kind == "noise":  # does not compress: kept plain
        u = np.random.default_rng(0).uniform(-3.0, 3.0, u.shape)
    elif kind == "missing":
        u[700:] = np.nan
    store = store_of(tmp_path, u, f"keep.dtype={dtype}")
    whole, series = store.series(0).T, store.node_series(0)
    assert series.shape == whole.shape
    for part in (slice(0, 1), slice(149, 150), slice(7, 93), slice(None), slice(3, 140, 17)):
        np.testing.assert_array_equal(series[part], whole[part])
    assert series[5:5].shape == (0, 2001)


def test_damage_is_found_and_a_point_that_never_ran_is_said(tmp_path: Path) -> None:
    store = store_of(tmp_path, np.random.default_rng(0).normal(size=(300, 50)))
    with pytest.raises(BadInput, match="point 5 has not been run"):
        store.node_series(5)
    file = store.files.file("u", 0)
    data = bytearray(file.read_bytes())
    data[1000] ^= 1
    file.write_bytes(data)
    with pytest.raises(DamagedChunk, match="block 0, u: wrong checksum"):
        store.node_series(0)
    file.unlink()
    with pytest.raises(DamagedChunk, match="missing"):
        store.node_series(0)
    assert Status.DONE in store.status()
