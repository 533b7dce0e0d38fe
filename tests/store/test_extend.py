"""Stores that grow, and the metadata that may change between runs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from store_tools import block_results, make_store, results, small_sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.claims import claim_block
from chimera_hpc.store.store import Store


class Killed(Exception):
    """Stands for the end of the process."""


MORE = small_sweep("seeds=8", "grid.P=2:5")


@pytest.fixture
def store(filled: Store) -> Store:
    return filled


def test_extension_appends_new_points_and_touches_no_finished_one(store: Store) -> None:
    files = {
        p: p.read_bytes() for name in store.files.shapes for p in (store.path / name).glob("c*")
    }
    larger = store.extend(MORE)
    assert (larger.n_points, larger.n_blocks, larger.block_size) == (32, 8, 4)
    assert {path: path.read_bytes() for path in files} == files
    for name, column in store.points.columns.items():
        np.testing.assert_array_equal(larger.points.columns[name][:15], column)
    wanted = {tuple(MORE.points().row(i).values()) for i in range(32)}
    assert {tuple(larger.points.row(i).values()) for i in range(32)} == wanted
    assert larger.status()[Status.DONE] == 15
    assert larger.pending() == [3, 4, 5, 6, 7]
    assert larger.points_to_do(3).tolist() == [3]


def test_extended_store_is_filled_and_read_like_any_other(store: Store) -> None:
    before = store.files.read("features", 3)
    larger = store.extend(MORE)
    for block in larger.pending():
        rows = larger.points_to_do(block)
        made = results(larger, larger.block(block)[0] + rows)
        larger.write_block(block, made, 2, 1, rows=rows)
    assert larger.find_damaged(deep=True) == []
    np.testing.assert_array_equal(larger.features(), results(larger, range(32)).features)
    assert larger.files.read("features", 3)[:3].tobytes() == before[:3].tobytes()
    with xr.open_zarr(larger.path, chunks=None) as data:
        assert data.sizes["point"] == 32
        np.testing.assert_array_equal(data["P"], larger.points.columns["P"])
        assert np.isfinite(data["u"].values).all()


def test_owner_who_opened_the_store_before_loses_nothing_of_the_extension(store: Store) -> None:
    store.discard_block(3)
    larger = store.extend(MORE)
    larger.write_block(3, results(larger, [15]), 2, 1, rows=[3])
    store.write_block(3, block_results(store, 3), 1, 1)
    assert (larger.ledger()["status"][12:16] == Status.DONE).all()
    np.testing.assert_array_equal(larger.features()[15], results(larger, [15]).features[0])


def test_earlier_sweep_is_accepted_after_an_extension(store: Store) -> None:
    larger = store.extend(MORE)
    larger.check_spec(small_sweep())
    larger.check_spec(MORE)
    assert larger.sweep == MORE
    assert larger.extend(MORE).n_points == 32


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["seeds=4"], r"must hold all points of the store, not so P=2, Q=2, .*seed=4"),
        (["grid.P=3:5"], "must hold all points of the store, not so P=2"),
        (["integrator.rtol=1e-4", "seeds=9"], "may change axes only, not integrator"),
        (["fixed.n_nodes=13", "seeds=9"], "may change axes only, not fixed.n_nodes"),
        (["keep.series=none", "seeds=9"], "may change axes only, not keep"),
    ],
)
def test_extension_by_something_else_is_bad_input(
    store: Store, overrides: list[str], message: str
) -> None:
    root = (store.path / "zarr.json").read_bytes()
    with pytest.raises(BadInput, match=message):
        store.extend(small_sweep(*overrides))
    assert (store.path / "zarr.json").read_bytes() == root
    assert list((store.path / "claims").iterdir()) == []


def test_first_seed_stays_the_first_where_only_its_series_is_kept(tmp_path: Path) -> None:
    store = make_store(tmp_path, "keep.series=first-seed")
    with pytest.raises(BadInput, match="may not change the first seed"):
        store.extend(small_sweep("keep.series=first-seed", "seeds=[9,0,1,2,3,4]"))


def test_killed_extension_has_not_happened(store: Store, monkeypatch: Any) -> None:
    replace, count = os.replace, 0

    def dying(source: Path, target: Path) -> None:
        nonlocal count
        count += 1
        if count > stage:
            raise Killed
        replace(source, target)

    monkeypatch.setattr(os, "replace", dying)
    # The arrays with points; three chunks of each coordinate and one of time; the copy of the
    # root; the root.
    n_columns = len(store.points.columns)
    last = (n_columns + 5) + (3 * n_columns + 1) + 2
    for allowed in (0, 6, 13, 30, last - 2, last - 1):
        count, stage = 0, allowed
        with pytest.raises(Killed):
            store.extend(MORE)
        present = Store.open(store.path)
        assert present.n_points == 15
        assert present.status()[Status.DONE] == 15
        count, stage = 0, 1000
        present.repair()
    count, stage = 0, last
    assert store.extend(MORE).n_points == 32


@pytest.mark.parametrize("finish", ["reduce", "repair", "adopt"])
def test_what_a_killed_extension_left_does_not_count_later(
    store: Store, monkeypatch: Any, finish: str
) -> None:
    def killed(*_: Any) -> None:
        raise Killed

    monkeypatch.setattr("chimera_hpc.store.extend.write_root", killed)
    with pytest.raises(Killed):
        store.extend(MORE)
    monkeypatch.undo()
    present = Store.open(store.path)
    if finish == "reduce":
        present.write_reduction({"a": (("k",), [1])}, {})
    elif finish == "adopt":
        present.adopt(small_sweep("run.workers=3"))
    else:
        present.repair()
    assert Store.open(store.path).n_points == 15
    with xr.open_zarr(store.path, chunks=None) as data:
        assert data.sizes["point"] == 15


def test_other_spec_is_refused_with_the_keys_that_differ(store: Store) -> None:
    other = small_sweep("grid.P=3:4", "integrator.rtol=1e-6")
    with pytest.raises(BadInput, match=r"holds another sweep: grid.P: .* here, 2:4 in the store"):
        store.check_spec(other)
    with pytest.raises(BadInput, match=r"integrator.rtol: 1e-06 here, 0.001 in the store"):
        store.check_spec(other)
    with pytest.raises(BadInput, match="keep may not change within one store, it has series=all"):
        store.check_spec(small_sweep("keep.dtype=float32"))


def test_sweep_with_more_points_is_told_to_extend(store: Store) -> None:
    with pytest.raises(BadInput, match=r"seeds: 7 here, 5 in the store.*: extend$"):
        store.check_spec(small_sweep("seeds=7"))
    for other in ("seeds=3", "P=3:4", "integrator.rtol=1e-6"):
        with pytest.raises(BadInput, match=r"holds another sweep") as caught:
            store.check_spec(small_sweep(other))
        assert "extend" not in str(caught.value)


def test_what_is_outside_the_digest_may_change(store: Store) -> None:
    changed = small_sweep("run.workers=3", 'reduction.linkage="average"', "keep.series=all")
    adopted = store.adopt(changed)
    assert adopted.sweep.run.workers == Store.open(store.path).sweep.run.workers == 3
    assert adopted.sweep.reduction.linkage == "average"
    assert adopted.status()[Status.DONE] == 15
    root = (store.path / "zarr.json").read_bytes()
    adopted.adopt(changed)
    assert (store.path / "zarr.json").read_bytes() == root


def test_change_of_metadata_waits_for_others(store: Store, monkeypatch: Any) -> None:
    claim = claim_block(store.path, "metadata", 0)
    assert claim is not None
    monkeypatch.setattr("chimera_hpc.store.extend._PATIENCE", 0.1)
    with pytest.raises(BadInput, match="another process keeps changing the store"):
        store.adopt(small_sweep("run.workers=3"))
    claim.release()
    assert store.adopt(small_sweep("run.workers=3")).sweep.run.workers == 3
