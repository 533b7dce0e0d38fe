"""Some nodes of a stored series, without the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr
from store_tools import encode_series, results, small_sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import DamagedChunk
from chimera_hpc.store.merge import merge
from chimera_hpc.store.schema import decode_series
from chimera_hpc.store.store import Store
from chimera_hpc.store.strips import PackedSeries, StoredSeries


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
    # Of a sweep whose networks differ in size.
    assert [StoredSeries(store.files, 0, n)[:].shape[0] for n in (None, 90)] == [150, 90]


def test_damage_is_found_and_a_point_that_never_ran_is_said(tmp_path: Path) -> None:
    store = store_of(tmp_path, np.random.default_rng(0).normal(size=(300, 50)))
    with pytest.raises(BadInput, match="point 5 has not been run"):
        store.node_series(5)
    file = store.files.file("u", 0)
    data = bytearray(file.read_bytes())
    data[1000] ^= 1
    file.write_bytes(data)
    with pytest.raises(DamagedChunk, match="block 0, u: wrong checksum"):
        store.node_series(0)[:1]
    file.unlink()
    with pytest.raises(DamagedChunk, match="missing"):
        store.node_series(0)
    assert Status.DONE in store.status()


@pytest.fixture
def cut(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have series of more than 20 kB cut into pieces of 5 kB."""
    monkeypatch.setattr("chimera_hpc.store.schema.WHOLE_SERIES", 20_000)
    monkeypatch.setattr("chimera_hpc.store.schema.SERIES_PIECE", 5_000)


@pytest.mark.parametrize(("n_times", "n_nodes"), [(307, 61), (1001, 11), (3, 4999), (5000, 9)])
@pytest.mark.parametrize("dtype", ["int16", "float32"])
def test_large_series_are_cut_and_read_as_if_they_were_not(
    tmp_path: Path, dtype: str, n_times: int, n_nodes: int, cut: None
) -> None:
    u = np.sin(0.1 * np.arange(float(n_times))[:, None] + np.arange(n_nodes))
    u[1:, n_nodes // 2 :] = np.nan
    store = store_of(tmp_path, u, f"keep.dtype={dtype}")
    array = zarr.open_array(store.path / "u", mode="r")
    times, nodes = array.chunks[1:]
    assert times * nodes * array.dtype.itemsize <= 5_000
    if min(n_times, n_nodes) > 10:
        assert times < n_times
        assert nodes < n_nodes
    whole, series = store.series(0), store.node_series(0)
    np.testing.assert_allclose(whole, u, rtol=0, atol=6e-5)
    np.testing.assert_array_equal(decode_series(np.asarray(array[0])), whole)
    np.testing.assert_array_equal(store.files.read("u", 0)[0], np.asarray(array[0]))
    for part in (slice(0, 1), slice(1, n_nodes - 1), slice(None), slice(0, n_nodes, 2)):
        np.testing.assert_array_equal(series[part], whole.T[part])
    with xr.open_zarr(store.path, chunks=None) as opened:
        np.testing.assert_allclose(opened.u[0, 1, :2], u[1, :2], rtol=0, atol=6e-5)
    assert not Store.open(store.path).find_damaged(deep=True)


def test_one_node_and_a_stretch_of_time_are_read_without_the_rest(
    tmp_path: Path, cut: None
) -> None:
    u = np.random.default_rng(0).normal(size=(400, 100))
    store = store_of(tmp_path, u)
    size = store.files.file("u", 0).stat().st_size
    array = zarr.open_array(Counting(store.path), path="u", mode="r")
    for times, nodes in ((slice(None), slice(7, 8)), (slice(40, 60), slice(None))):
        Counting.bytes = 0
        assert np.asarray(array[0, times, nodes]).size
        # Zarr from 3.4 on reads pieces that are near each other at once.
        assert 0 < Counting.bytes < 0.6 * size


class Counting(zarr.storage.LocalStore):
    """A folder that counts the bytes of chunks that are read."""

    bytes = 0

    async def get(self, key: str, prototype: Any = None, byte_range: Any = None) -> Any:
        data = await super().get(key, prototype, byte_range)
        if "/c." in key and data is not None:
            Counting.bytes += len(data)
        return data


def test_series_of_stores_that_were_not_cut_are_read_and_added_to(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    u = np.sin(np.arange(400.0)[:, None] + np.arange(100))
    before = store_of(tmp_path, u)
    request.getfixturevalue("cut")
    store = Store.open(before.path)
    assert store.files.piece == (400, 100)
    store.write_block(1, results(store, range(4, 8)), store.start_run({}), 1)
    assert not Store.open(before.path).find_damaged(deep=True)
    np.testing.assert_array_equal(store.series(0), before.series(0))
    merged = tmp_path / "merged.zarr"
    merge(merged, [store])
    assert Store.open(merged).files.piece != (400, 100)
    np.testing.assert_array_equal(Store.open(merged).series(0), before.series(0))


def test_series_of_steady_runs_are_packed_and_those_that_never_ran_are_missing(
    tmp_path: Path,
) -> None:
    store = Store.plan(tmp_path / "store.zarr", small_sweep())
    made = results(store, range(4))
    made.status[:3] = Status.DONE, Status.STEADY, Status.NO_WINDOW
    store.write_block(0, made, store.start_run({}), 1)
    packed = decode_series(PackedSeries(store)[0:5, :, :])
    for point in range(3):
        np.testing.assert_array_equal(packed[point], store.series(point))
    assert np.isnan(packed[4]).all()
