"""Runs, reductions and the labelled dataset."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from store_tools import block_results, fill, make_store, results

import chimera_hpc
from chimera_hpc.base.errors import BadInput
from chimera_hpc.store.runs import (
    BlockWork,
    block_work,
    read_run,
    record_work,
    run_numbers,
    start_run,
)
from chimera_hpc.store.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return make_store(tmp_path)


def test_work_of_all_runs_that_recorded_it_is_added(tmp_path: Path) -> None:
    for work in ({"points": 4, "core_seconds": 2.5}, {}, {"points": 6, "core_seconds": 1.5}):
        number = start_run(tmp_path, {})
        record_work(tmp_path, number, work)
    start_run(tmp_path, {})
    assert block_work(tmp_path) == BlockWork(10, 4.0)


def test_runs_are_numbered_and_say_what_they_are(store: Store) -> None:
    assert store.start_run({"user": "ada"}) == 1
    assert store.start_run({}) == 2
    (store.path / "runs" / "notes.json").write_text("")
    assert run_numbers(store.path) == [1, 2]
    assert read_run(store.path, 1) == {"run": 1, "user": "ada"}
    with pytest.raises(BadInput, match="run 7 has left no readable record"):
        read_run(store.path, 7)


def test_runs_started_at_once_get_different_numbers(store: Store) -> None:
    numbers: list[int] = []
    threads = [
        threading.Thread(target=lambda: numbers.append(store.start_run({}))) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(numbers) == list(range(1, 9))


def test_reduction_is_read_back_and_replaced(store: Store) -> None:
    label = np.arange(15) % 3
    store.write_reduction(
        {
            "label_3": (("point",), label, {"long_name": "cluster at cut 3"}),
            "linkage": (("merge", "column"), np.ones((2, 4))),
        },
        {"names": {"3": ["ordered", "chimera", "disordered"]}},
    )
    found = store.reduction()
    np.testing.assert_array_equal(found.arrays["label_3"], label)
    assert found.attributes == {"names": {"3": ["ordered", "chimera", "disordered"]}}
    with xr.open_zarr(store.path, group="reduction", chunks=None) as data:
        assert data.label_3.dims == ("point",)
        assert data.label_3.attrs == {"units": "1", "long_name": "cluster at cut 3"}
    store.write_reduction({"other": (("k",), [1.5])}, {})
    assert list(store.reduction().arrays) == ["other"]
    assert [p.name for p in store.path.glob(".*")] == []
    nodes = Store.open(store.path).metadata["consolidated_metadata"]["metadata"]
    assert [name for name in nodes if name.startswith("reduction/")] == ["reduction/other"]


def test_no_reduction_yet_is_bad_input(store: Store) -> None:
    with pytest.raises(BadInput, match="not reduced yet"):
        store.reduction()


def test_text_in_a_reduction_is_refused(store: Store) -> None:
    with pytest.raises(TypeError, match="no settled type"):
        store.write_reduction({"names": (("k",), ["a"])}, {})


def test_opening_what_is_no_store_is_bad_input(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nothing"):
        with pytest.raises(BadInput, match="not a sweep's store"):
            Store.open(path)
        with pytest.raises(BadInput, match="not a sweep's store"):
            chimera_hpc.open(path)


def test_dataset_names_every_quantity(store: Store) -> None:
    fill(store)
    wanted = results(store, range(15))
    for path in (store.path.parent, store.path):
        with chimera_hpc.open(path) as data:
            np.testing.assert_array_equal(data["amplitude"], wanted.features[:, 0])
            np.testing.assert_array_equal(data["phase"], wanted.features[:, 2])
            assert data["phase"].dims == ("point", "node")
            assert data["phase"].attrs == {"units": "rad", "long_name": "phase"}
            np.testing.assert_array_equal(data["V_Omega"], wanted.scalars[:, 2])
            assert data["elapsed_us"].attrs["units"] == "us"
            assert data["cell"].values.tolist() == [0] * 5 + [1] * 5 + [2] * 5
            table = data[["V_theta", "status"]].set_index(point=["cell", "seed"]).unstack("point")
            assert dict(table.sizes) == {"cell": 3, "seed": 5}
            assert table["V_theta"].values[1, 2] == wanted.scalars[7, 0]


def test_dataset_shows_no_rows_that_the_ledger_does_not_vouch_for(store: Store) -> None:
    fill(store)
    os.unlink(store.files.file("ledger", 1))
    with chimera_hpc.open(store.path) as data:
        ran = data["status"].values != 255
        assert np.flatnonzero(~ran).tolist() == [4, 5, 6, 7]
        for name in ("amplitude", "V_theta"):
            assert np.isnan(data[name].values[~ran]).all()
            assert np.isfinite(data[name].values[ran]).all()


def test_series_that_are_not_there_are_bad_input(store: Store, tmp_path: Path) -> None:
    store.write_block(0, block_results(store, 0), 1, 1)
    with pytest.raises(BadInput, match="point 9 has not been run"):
        store.series(9)
    with pytest.raises(IndexError):
        store.series(15)
    none = make_store(tmp_path / "none", "keep.series=none")
    with pytest.raises(BadInput, match="the series of point 2 is not kept"):
        none.series(2)


def test_runs_file_is_whole_json(store: Store) -> None:
    number = store.start_run({"command": ["a", "b"]})
    text = (store.path / "runs" / f"{number}.json").read_text()
    assert json.loads(text) == {"run": 1, "command": ["a", "b"]}
