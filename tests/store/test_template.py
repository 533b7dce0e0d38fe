"""The template: readable by others without a warning, laid out as agreed, all of it or nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from store_tools import block_results, fill, make_store, plan, process_context, small_sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.ledger import FIELDS
from chimera_hpc.store.reduction import write_reduction
from chimera_hpc.store.schema import room
from chimera_hpc.store.store import Store


def nodes(store: Store) -> dict[str, Any]:
    found: dict[str, Any] = store.metadata["consolidated_metadata"]["metadata"]
    return found


READER = """
import sys
import numpy as np
import xarray as xr

assert "chimera_hpc" not in sys.modules
try:
    import chimera_hpc
except ImportError:
    pass
else:
    raise SystemExit("chimera_hpc can be imported")
for chunks in ({}, None):
    with xr.open_zarr(sys.argv[1], chunks=chunks) as data:
        labels = dict(feature=8, quantity=15, mark=2, field=7)
        assert dict(data.sizes) == dict(point=15, time=21, node=12, **labels)
        for name in "P Q seed orientation flips flip_set epsilon b c delta".split():
            assert data[name].dims == ("point",) and name in data.coords, name
            assert name in data.u.coords and name in data.ledger.coords
        for name, array in data.variables.items():
            assert array.attrs["units"] and array.attrs["long_name"], name
        assert data.u.dims == ("point", "time", "node") and data.u.dtype == "float64"
        assert data.u.encoding["dtype"] == "int16"
        assert np.allclose(data.time, np.arange(10, 20.1, 0.5))
        labelled = dict(features="feature", scalars="quantity", quality="mark", ledger="field")
        for name, dimension in labelled.items():
            assert len(data[name].attrs["labels"]) == data.sizes[dimension]
        assert (data.ledger.values[:, 0] == 255).sum() == 11
        assert np.isnan(data.u.values).sum() == 11 * 21 * 12
        assert np.isnan(data.features.values).sum() == 11 * 8 * 12
print("read")
"""


@pytest.mark.slow
def test_others_read_it_with_xarray_and_without_a_warning(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    store.write_block(1, block_results(store, 1), store.start_run({}), 1)
    command = [sys.executable, "-I", "-W", "error", "-c", HIDE + READER, str(store.path)]
    done = subprocess.run(command, cwd="/", capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("read\n", "")


# An installed package would be found even from elsewhere: hide it.
HIDE = "import sys\nsys.modules['chimera_hpc'] = None\ndel sys.modules['chimera_hpc']\n" + (
    "class Hide:\n"
    "    def find_spec(self, name, path=None, target=None):\n"
    "        if name.partition('.')[0] == 'chimera_hpc':\n"
    "            raise ImportError(name)\n"
    "sys.meta_path.insert(0, Hide())\n"
)


def test_zarr_lists_the_arrays_and_nothing_else(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    store.start_run({})
    names = dict(zarr.open_group(store.path, mode="r").members())
    coordinates = {
        "P",
        "Q",
        "seed",
        "orientation",
        "flips",
        "flip_set",
        "epsilon",
        "b",
        "c",
        "delta",
    }
    coordinates = set(store.points.columns)
    assert set(names) == {"u", "time", "features", "scalars", "quality", "ledger"} | coordinates


def test_consolidated_metadata_are_what_zarr_would_write(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    store.write_reduction({"label": (("point",), np.arange(15))}, {"names": ["a"]})
    ours = json.loads((store.path / "zarr.json").read_bytes())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(store.path)
    assert json.loads((store.path / "zarr.json").read_bytes()) == ours


def test_root_attributes_hold_the_whole_spec(tmp_path: Path) -> None:
    sweep = small_sweep()
    attributes = Store.plan(tmp_path / "s.zarr", sweep).metadata["attributes"]
    assert attributes["spec"] == sweep.to_dict()
    assert attributes["digest"] == sweep.digest
    assert (attributes["stream_tag"], attributes["schema"]) == (1, 1)


def test_every_chunk_has_a_checksum(tmp_path: Path) -> None:
    for name, node in nodes(make_store(tmp_path)).items():
        codecs = node["codecs"]
        if name == "u":
            inner = codecs[0]["configuration"]
            assert inner["codecs"][-1] == {"name": "crc32c"}
            assert inner["index_codecs"][-1] == {"name": "crc32c"}
        else:
            assert codecs[-1] == {"name": "crc32c"}, name


def test_ledger_is_plain_bytes_and_a_checksum(tmp_path: Path) -> None:
    node = nodes(make_store(tmp_path))["ledger"]
    little = {"name": "bytes", "configuration": {"endian": "little"}}
    assert node["codecs"] == [little, {"name": "crc32c"}]
    assert (node["data_type"], node["fill_value"]) == ("int64", 255)
    assert node["attributes"]["labels"] == list(FIELDS)


def test_one_chunk_a_block_and_one_inner_chunk_a_point(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    for name in ("u", "features", "scalars", "quality", "ledger"):
        grid = nodes(store)[name]["chunk_grid"]["configuration"]["chunk_shape"]
        assert grid[0] == store.block_size == 4
    inner = nodes(store)["u"]["codecs"][0]["configuration"]["chunk_shape"]
    assert inner == [1, 21, 12]


@pytest.mark.parametrize(
    ("keep", "dtype", "fill"),
    [
        ((), "int16", -32768),
        (("keep.dtype=float32",), "float32", "NaN"),
        (("keep.series=none",), None, None),
    ],
)
def test_series_are_kept_as_asked(
    tmp_path: Path, keep: tuple[str, ...], dtype: str | None, fill: Any
) -> None:
    found = nodes(make_store(tmp_path, *keep))
    if dtype is None:
        assert not {"u", "time"} & set(found)
        return
    assert (found["u"]["data_type"], found["u"]["fill_value"]) == (dtype, fill)
    attributes = found["u"]["attributes"]
    if dtype == "int16":
        assert (attributes["scale_factor"], attributes["_FillValue"]) == (1e-4, -32768)
        assert "3.2767 do not fit and are stored as missing" in attributes["comment"]
    else:
        assert not {"scale_factor", "_FillValue"} & set(attributes)


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["all", "none", "first-seed"])
def test_files_and_room_are_what_plan_says(tmp_path: Path, keep: str) -> None:
    store = fill(make_store(tmp_path, f"keep.series={keep}", "seeds=40", "run.block=3"))
    store.start_run({})
    paths = [p for p in store.path.rglob("*") if p.is_file()]
    told = room(store.sweep, store.points.columns, store.block_size)
    assert told.blocks == store.n_blocks == 40
    assert len(paths) == told.files <= 5 * store.n_blocks + 200
    size = sum(path.stat().st_size for path in paths)
    assert size <= told.bytes <= 3 * size


def test_plan_refuses_a_path_that_exists(tmp_path: Path) -> None:
    store = fill(make_store(tmp_path))
    with pytest.raises(BadInput, match="exists already"):
        Store.plan(store.path, small_sweep())
    assert store.status()[Status.DONE] == 15
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="exists already"):
        Store.plan(tmp_path / "empty", small_sweep())


def test_plan_where_nothing_can_be_written_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(BadInput, match=r"no store can be made here: .*\(.*/file\)"):
        Store.plan(tmp_path / "file" / "store.zarr", small_sweep())


def test_of_two_planners_one_makes_the_store(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "store.zarr"
    rename = os.rename

    def late(source: Path, target: Path) -> None:
        monkeypatch.setattr(os, "rename", rename)
        fill(Store.plan(path, small_sweep()))
        rename(source, target)

    monkeypatch.setattr(os, "rename", late)
    with pytest.raises(BadInput, match="no store can be made here"):
        Store.plan(path, small_sweep())
    assert Store.open(path).status()[Status.DONE] == 15


def test_killed_planner_leaves_a_whole_store_or_none(tmp_path: Path) -> None:
    context, rng = process_context(), np.random.default_rng(3)
    outcomes = []
    for trial in range(4):
        path = tmp_path / str(trial) / "store.zarr"
        process = context.Process(target=plan, args=(path,))
        process.start()
        while not path.parent.exists():
            time.sleep(1e-4)
        time.sleep(rng.uniform(0, 0.1))
        process.kill()
        process.join()
        outcomes.append(path.exists())
        store = Store.open(path) if path.exists() else Store.plan(path, small_sweep())
        assert store.repair() == []
        assert [p.name for p in path.parent.iterdir()] == ["store.zarr"]
    assert False in outcomes


def test_a_million_points_are_planned_in_seconds(tmp_path: Path) -> None:
    began = time.process_time()
    store = make_store(tmp_path, "seeds=333334", "run.block=300", "keep.series=none")
    assert store.n_points > 10**6
    assert time.process_time() - began < 15.0
    assert sum(1 for p in store.path.rglob("*") if p.is_file()) < 200


def test_killed_reduction_leaves_the_old_one_or_none(tmp_path: Path, monkeypatch: Any) -> None:
    store = make_store(tmp_path)
    store.write_reduction({"a": (("k",), [1.0])}, {"which": "old"})
    rename, calls = os.rename, []

    def dying(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) == stage:
            raise InterruptedError
        rename(source, target)

    monkeypatch.setattr(os, "rename", dying)
    for stage in (1, 2):
        calls.clear()
        with pytest.raises(InterruptedError):
            write_reduction(store.path, {"a": (("k",), [2.0])}, {"which": "new"})
        if stage == 1:
            assert store.reduction().attributes["which"] == "old"
        else:
            with pytest.raises(BadInput, match="not reduced yet"):
                store.reduction()
    monkeypatch.undo()
    store.write_reduction({"a": (("k",), [3.0])}, {"which": "newest"})
    assert store.reduction().arrays["a"].tolist() == [3.0]
