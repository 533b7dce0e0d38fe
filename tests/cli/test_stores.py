"""Commands on stores: why, verify, extend, merge, export, status."""

from __future__ import annotations

import csv
import errno
import json
import os
import shutil
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from jobs_for_tests import SMALL, job_text

import chimera_hpc
from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.store.block_result import failed_block
from chimera_hpc.store.ledger import FIELDS, point_digest, read_ledger
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

Run = Callable[..., tuple[int, str, str]]
SERIAL = ("--cluster", "serial", "--no-figures")


def store_of(folder: Path) -> Store:
    return Store.open(folder / "store.zarr")


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def flip(path: Path, place: int = 30) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1
    path.write_bytes(data)


# why


def test_why_tells_status_tries_digest_and_origin_of_one_point(finished: Path, sweep: Run) -> None:
    code, out, _ = sweep("why", finished, "P=3", "seed=2")
    store = store_of(finished)
    i = int(store.points.find(P=3, seed=2)[0])
    digest = int(store.ledger()["digest"][i]) & (2**64 - 1)
    assert code == 0
    assert f"P=3 Q=3 seed=2  (point {i}, block {i // 4})" in out
    assert "1 try" in out
    assert f"digest {digest:016x}" in out
    assert "run 1, started 20" in out


def test_point_of_a_large_seed_is_the_one_that_is_asked_for(tmp_path: Path, sweep: Run) -> None:
    seeds = [1_700_000_000, 1_700_000_001, 2**62, 2**62 + 1]
    job = job_text(SMALL, {"grid.P": 3, "grid.seeds": seeds})
    path = tmp_path / "big" / "store.zarr"
    Store.plan(path, Sweep.from_toml_text(job))
    for i, seed in enumerate(seeds):
        code, out, _ = sweep("why", path.parent, f"seed={seed}")
        assert (code, out.splitlines()[0]) == (0, f"seed={seed}  (point {i}, block 0)")
    for absent, near in ((1_700_000_002, 1_700_000_001), (2**62 + 2, 2**62 + 1)):
        for command in ("why", "show"):
            code, _, err = sweep(command, path.parent, f"seed={absent}")
            assert code == 2
            assert f"there is no such point in {path}; the nearest seed is {near}" in err


def test_why_says_that_a_point_never_ran(finished: Path, sweep: Run) -> None:
    (finished / "store.zarr" / "ledger" / "c.0.0").unlink()
    code, out, _ = sweep("why", finished, "P=2", "seed=0")
    assert code == 0
    assert "never run" in out
    assert "digest" not in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["P=9"], "there is no such point"),
        (["R=1"], "unknown 'R'"),
        (["P"], "NAME=NUMBER is needed"),
        (["sigma=1"], "unknown 'sigma'"),
        (["P=x"], "P"),
    ],
)
def test_why_refuses_a_point_that_is_none(
    words: list[str], message: str, finished: Path, sweep: Run
) -> None:
    code, _, err = sweep("why", finished, *words)
    assert code == 2
    assert message in err
    assert len(err.splitlines()) == 1


# verify


def test_verify_finds_nothing_wrong_with_a_sound_store(finished: Path, sweep: Run) -> None:
    before = contents(finished)
    code, out, _ = sweep("verify", finished)
    assert code == 0
    assert "stored: 4 blocks decoded, 0 chunks damaged" in out
    assert "sample: 1 of" in out
    assert contents(finished) == before


@pytest.mark.parametrize("array", ["u", "features", "scalars", "quality"])
def test_verify_names_a_flipped_byte_and_run_mends_it(
    array: str, job: Path, finished: Path, sweep: Run
) -> None:
    before = store_of(finished)
    features, digest = before.features(), before.ledger()["digest"]
    chunk = sorted((finished / "store.zarr" / array).glob("c.2*"))[0]
    flip(chunk)
    code, out, _ = sweep("verify", finished, "--stored")
    assert code == 1
    assert f"block 2, {array}: " in out
    assert sweep("verify", finished, "--stored", "--forget")[0] == 1
    assert read_ledger(finished / "store.zarr")["status"].tolist().count(255) == 4
    assert sweep("run", job, "--out", finished, *SERIAL)[0] == 0
    assert sweep("verify", finished, "--stored")[0] == 0
    after = store_of(finished)
    assert after.features().tobytes() == features.tobytes()
    assert (after.ledger()["digest"] == digest).all()


def test_verify_says_which_code_made_a_point_that_comes_out_otherwise(
    finished: Path, sweep: Run
) -> None:
    store = store_of(finished)
    record = store.path / "runs" / "1.json"
    record.write_text(json.dumps({**json.loads(record.read_bytes()), "python": "2.7.18"}))
    done = int(np.flatnonzero(store.ledger()["status"] == 1)[0])
    block, row = divmod(done, store.block_size)
    names = ("features", "scalars", "ledger")
    chunks = {name: store.files.read(name, block).copy() for name in names}
    chunks["features"][row, 1] += 0.125
    found = point_digest(chunks["features"][row], chunks["scalars"][row])
    chunks["ledger"][row, FIELDS.index("digest")] = found
    store.files.write(block, chunks)
    assert sweep("verify", finished, "--stored")[0] == 0
    code, out, _ = sweep("verify", finished, "--sample", "1")
    assert code == 1
    assert "points recomputed, 1 different" in out
    assert "largest difference of a feature or scalar 0.125" in out
    assert "run 1: python: 2.7.18 before" in out


def test_code_that_has_changed_since_is_told_of_though_the_numbers_are_the_same(
    finished: Path, sweep: Run
) -> None:
    record = finished / "store.zarr" / "runs" / "1.json"
    record.write_text(json.dumps({**json.loads(record.read_bytes()), "python": "2.7.18"}))
    code, out, _ = sweep("verify", finished, "--sample", "1")
    assert code == 0
    assert "0 different\n  run 1: python: 2.7.18 before" in out
    assert "  since then: python: 2.7.18 before" in sweep("why", finished, "P=3", "seed=2")[1]


@pytest.mark.parametrize("words", [["--sample", "2"], ["--sample", "nan"], ["--seed", "-1"]])
def test_verify_refuses_shares_that_are_none(words: list[str], finished: Path, sweep: Run) -> None:
    code, _, err = sweep("verify", finished, *words)
    assert code == 2
    assert words[0] in err


# extend


def test_extend_adds_points_and_touches_no_finished_one(
    job: Path, finished: Path, sweep: Run
) -> None:
    before = store_of(finished).ledger()
    code, out, _ = sweep("extend", job, "--set", "seeds=7", "--set", "P=2:5", "--out", finished)
    assert code == 0
    assert "13 points added, 28 in all" in out
    assert sweep("run", job, "--out", finished, *SERIAL)[0] == 0
    after = store_of(finished).ledger()
    for name, column in before.items():
        assert (after[name][:15] == column).all(), name
    assert (after["status"] != 255).all()
    code, out, _ = sweep("extend", job, "--set", "seeds=7", "--set", "P=2:5", "--out", finished)
    assert code == 0
    assert "0 points added" in out


@pytest.mark.slow
def test_extended_sweep_has_the_digests_of_one_planned_so(
    job: Path, finished: Path, tmp_path: Path, sweep: Run
) -> None:
    sweep("extend", job, "--set", "seeds=6", "--out", finished)
    sweep("run", job, "--out", finished, *SERIAL)
    sweep("run", job, "--set", "seeds=6", "--out", tmp_path / "whole", *SERIAL)
    assert digests(finished) == digests(tmp_path / "whole")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("integrator.rtol=1e-5", "an extension may change axes only, not integrator"),
        ("seeds=2", "an extension must hold all points of the store"),
    ],
)
def test_extend_refuses_what_is_no_extension(
    setting: str, message: str, job: Path, finished: Path, sweep: Run
) -> None:
    before = contents(finished)
    code, _, err = sweep("extend", job, "--set", setting, "--out", finished)
    assert code == 2
    assert message in err
    assert contents(finished) == before


def digests(folder: Path) -> dict[tuple[int, int], int]:
    """Return the digest of each point by P and seed."""
    store = store_of(folder)
    keys = zip(
        store.points.columns["P"].tolist(), store.points.columns["seed"].tolist(), strict=True
    )
    return dict(zip(keys, store.ledger()["digest"].tolist(), strict=True))


# merge


@pytest.fixture(scope="module")
def _parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    (folder / "job.toml").write_text(job_text(SMALL))
    for name, seeds in (("first", "[0,1,2]"), ("second", "[2,3,4]")):
        words = ["run", str(folder / "job.toml"), "--out", str(folder / name), *SERIAL]
        assert main([*words, "--set", f"seeds={seeds}"]) == 0
    return folder


@pytest.fixture
def parts(_parts: Path, tmp_path: Path) -> list[Path]:
    """Two sweeps that share seed 2; copies for each test."""
    return [shutil.copytree(_parts / name, tmp_path / name) for name in ("first", "second")]


def test_merged_sweep_equals_one_run_as_a_whole(
    parts: list[Path], finished: Path, tmp_path: Path, sweep: Run
) -> None:
    code, out, _ = sweep("merge", *parts, "--out", tmp_path / "all")
    assert code == 0
    assert f"9 points from {parts[0]}" in out
    assert f"6 points from {parts[1]}" in out
    assert digests(tmp_path / "all") == digests(finished)
    assert sweep("verify", tmp_path / "all", "--stored")[0] == 0
    assert sweep("reduce", tmp_path / "all", "--no-figures")[0] == 0
    merged, whole = store_of(tmp_path / "all"), store_of(finished)
    i, j = (int(store.points.find(P=4, seed=4)[0]) for store in (merged, whole))
    assert np.array_equal(merged.series(i), whole.series(j))


def test_merge_keeps_which_run_made_which_point(
    parts: list[Path], tmp_path: Path, sweep: Run
) -> None:
    sweep("merge", *parts, "--out", tmp_path / "all")
    store = store_of(tmp_path / "all")
    assert set(store.ledger()["run"].tolist()) == {1, 2}
    made = json.loads((store.path / "runs" / "2.json").read_bytes())
    assert made["merged from"] == {"store": str(parts[1] / "store.zarr"), "run": 1}
    assert made["run"] == 2
    assert made["package"]["name"] == "chimera_hpc"


def test_conflicts_are_listed_and_the_first_store_counts(
    parts: list[Path], tmp_path: Path, sweep: Run
) -> None:
    store = store_of(parts[1])
    i = int(store.points.find(P=3, seed=2)[0])
    block, row = divmod(i, store.block_size)
    ledger = store.files.read("ledger", block).copy()
    ledger[row, -1] += 1
    store.files.write(block, {"ledger": ledger})
    code, out, _ = sweep("merge", *parts, "--out", tmp_path / "all")
    assert code == 1
    assert "1 points have different results; the first one was taken:\n  P=3 Q=3 seed=2\n" in out
    assert digests(tmp_path / "all")[3, 2] == digests(parts[0])[3, 2]


def test_merge_takes_a_result_where_the_other_store_has_none(
    parts: list[Path], finished: Path, tmp_path: Path, sweep: Run
) -> None:
    for chunk in (parts[0] / "store.zarr" / "ledger").glob("c.*"):
        chunk.unlink()
    assert sweep("merge", *parts, "--out", tmp_path / "all")[0] == 0
    ledger = read_ledger(tmp_path / "all" / "store.zarr")
    assert (ledger["status"] != 255).sum() == 9


def test_merge_takes_a_result_where_the_other_store_has_a_failure(
    parts: list[Path], tmp_path: Path, sweep: Run
) -> None:
    store = store_of(parts[0])
    i = int(store.points.find(P=3, seed=2)[0])
    block, row = divmod(i, store.block_size)
    ledger = store.files.read("ledger", block).copy()
    ledger[row, FIELDS.index("status")] = Status.TIME_OUT
    store.files.write(block, {"ledger": ledger})
    code, out, _ = sweep("merge", *parts, "--out", tmp_path / "all")
    assert code == 0
    assert f"8 points from {parts[0]}" in out
    merged = store_of(tmp_path / "all")
    assert merged.status()[Status.TIME_OUT] == 0
    assert digests(tmp_path / "all")[3, 2] == digests(parts[1])[3, 2]


@pytest.mark.slow
def test_merge_refuses_sweeps_that_differ_in_more_than_axes(
    job: Path, finished: Path, tmp_path: Path, sweep: Run
) -> None:
    words = ["run", job, "--out", tmp_path / "other", *SERIAL, "--set", "integrator.rtol=1e-4"]
    assert sweep(*words)[0] == 0
    code, _, err = sweep("merge", finished, tmp_path / "other", "--out", tmp_path / "all")
    assert code == 2
    assert "differs from" in err
    assert "in integrator" in err
    assert not (tmp_path / "all").exists()
    code, _, err = sweep("merge", finished, "--out", tmp_path / "all")
    assert code == 2
    assert "at least two" in err


def test_merge_does_not_touch_a_store_that_exists(
    parts: list[Path], finished: Path, sweep: Run
) -> None:
    before = contents(finished)
    code, _, err = sweep("merge", *parts, "--out", finished)
    assert code == 2
    assert "exists already" in err
    assert contents(finished) == before


def test_folder_of_a_sweep_stands_for_its_job(
    finished: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = sweep("run", finished, "--cluster", "serial", "--no-figures")
    assert code == 0
    assert "nothing to compute" in err
    code, _, err = sweep("run", finished, "--set", "seeds=7")
    assert code == 2
    assert "seeds: 7 here, 5 in the store; to add its points to this store: extend" in err
    code, out, _ = sweep("extend", finished, "--set", "seeds=7")
    assert code == 0
    assert f"to compute them: run {finished}" in out
    assert store_of(finished).n_points == 21
    assert not (tmp_path / "results").exists()


def test_names_of_classes_are_checked_before_anything_runs(job: Path, sweep: Run) -> None:
    code, _, err = sweep("plan", job, "--set", 'reduction.names=["steady","moving"]')
    assert code == 2
    assert "reduction.names holds 'steady'" in err


def test_reduction_of_a_folder_that_cannot_be_written_is_said(
    finished: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system", "store.zarr")

    monkeypatch.setattr(Store, "write_reduction", refuse)
    code, out, err = sweep("reduce", finished)
    assert code == 2
    assert "15 of 15 points run" in out
    assert "votes" in out
    assert "store.zarr: can't be written: Read-only file system" in err


# export


def test_table_has_a_line_a_point_with_all_digits(
    finished: Path, tmp_path: Path, sweep: Run
) -> None:
    assert sweep("export", finished, "--to", tmp_path / "table.csv")[0] == 0
    text = (tmp_path / "table.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    store = store_of(finished)
    assert len(rows) == 15
    assert {"P", "seed", "status", "V_theta", "V_a", "V_Omega", "class_3"} <= rows[0].keys()
    for i, row in enumerate(rows):
        assert int(row["P"]) == store.points.columns["P"][i]
        value = store.scalars()["V_theta"][i]
        assert (row["V_theta"] == "") == bool(np.isnan(value))
        assert row["V_theta"] == "" or float(row["V_theta"]) == value


@pytest.mark.parametrize("version", [3, 4])
def test_netcdf_holds_what_the_store_does(
    version: int, finished: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    if version == 3:
        monkeypatch.setattr("chimera_hpc.reduction.export._NETCDF_4", ())
    elif not find_spec("netCDF4"):
        pytest.skip("netCDF4 is not installed")
    target = tmp_path / "sweep.nc"
    assert sweep("export", finished, "--to", target, "--series")[0] == 0
    store = store_of(finished)
    with xr.open_dataset(target) as dataset:
        assert np.array_equal(dataset["amplitude"], store.features()[:, 0], equal_nan=True)
        digests = store.ledger()["digest"]
        texts = [f"{digest & (2**64 - 1):016x}" for digest in digests.tolist()]
        assert dataset["digest"].values.tolist() == (digests.tolist() if version == 4 else texts)
        assert np.array_equal(dataset["seed"], store.points.columns["seed"])
        assert np.allclose(dataset["u"][3], store.series(3), rtol=0, atol=1e-12)
        assert dataset.attrs["digest"] == store.sweep.digest
    assert sweep("export", finished, "--to", target)[0] == 0
    with xr.open_dataset(target) as dataset:
        assert "u" not in dataset


def test_netcdf_3_written_in_pieces_holds_the_same(
    finished: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chimera_hpc.reduction.export._NETCDF_4", ())
    for name, size in (("whole.nc", 10**9), ("pieces.nc", 10)):
        monkeypatch.setattr("chimera_hpc.reduction.export._SLICE_BYTES", size)
        assert sweep("export", finished, "--to", tmp_path / name, "--series")[0] == 0
    with (
        xr.open_dataset(tmp_path / "whole.nc") as whole,
        xr.open_dataset(tmp_path / "pieces.nc") as pieces,
        xr.open_dataset(tmp_path / "pieces.nc", mask_and_scale=False) as packed,
    ):
        xr.testing.assert_identical(whole, pieces)
        assert set(pieces.coords) == set(chimera_hpc.open(finished).coords)
        assert "chimera" in pieces["class_3"]
        assert packed["u"].dtype == np.int16
        assert packed["u"].attrs["_FillValue"].dtype == np.int16


@pytest.mark.parametrize("undivided", [False, True])
def test_large_series_are_exported_in_parts(
    undivided: bool, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chimera_hpc.reduction.export._NETCDF_4", ())
    monkeypatch.setattr("chimera_hpc.store.strips.PackedSeries.MOST", 30_000)
    if not undivided:
        monkeypatch.setattr("chimera_hpc.store.schema.WHOLE_SERIES", 20_000)
        monkeypatch.setattr("chimera_hpc.store.schema.SERIES_PIECE", 5_000)
    settings = {"grid.P": 3, "grid.seeds": 3, "fixed.n_nodes": 101, "keep.series": "all"}
    store = Store.plan(tmp_path / "store.zarr", Sweep.from_toml_text(job_text(SMALL, settings)))
    result = failed_block(store.sweep, store.block_points(0), Status.DONE)
    assert result.series is not None
    shape = result.series.shape
    result.series[:] = np.random.default_rng(0).integers(-3000, 3000, shape)
    store.write_block(0, result, 1, 1, rows=range(shape[0]))
    assert sweep("export", tmp_path, "--to", tmp_path / "u.nc", "--series")[0] == 0
    with xr.open_dataset(tmp_path / "u.nc", mask_and_scale=False) as dataset:
        np.testing.assert_array_equal(dataset["u"][: shape[0]], result.series)
        assert dataset["u"].dims == ("point", "time", "node")
        assert dataset["time"].values[-1] == pytest.approx(60.0)


def test_series_that_are_not_kept_are_not_exported(tmp_path: Path, sweep: Run) -> None:
    Store.plan(
        tmp_path / "store.zarr", Sweep.from_toml_text(job_text(SMALL, {"keep.series": "none"}))
    )
    status, _, said = sweep("export", tmp_path, "--to", tmp_path / "u.nc", "--series")
    assert status == 2
    assert "holds no series" in said
    assert not (tmp_path / "u.nc").exists()


def test_table_written_in_pieces_is_the_same(
    finished: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, rows in (("whole.csv", 100), ("pieces.csv", 4)):
        monkeypatch.setattr("chimera_hpc.reduction.export._SLICE_ROWS", rows)
        assert sweep("export", finished, "--to", tmp_path / name)[0] == 0
    assert (tmp_path / "pieces.csv").read_text() == (tmp_path / "whole.csv").read_text()


def test_seeds_of_64_bits_are_exported_with_all_their_bits(tmp_path: Path, sweep: Run) -> None:
    for seeds in ([3, 2**31], [3, 2**31 + 1, 2**53 - 1], [0, 2**53 + 1, 2**63 - 1]):
        folder = tmp_path / str(seeds[1])
        job = job_text(SMALL, {"grid.P": 3, "grid.seeds": seeds})
        Store.plan(folder / "store.zarr", Sweep.from_toml_text(job))
        for name in ("sweep.nc", "table.csv"):
            assert sweep("export", folder, "--to", folder / name)[0] == 0
        with xr.open_dataset(folder / "sweep.nc") as dataset:
            assert [int(seed) for seed in dataset["seed"].values] == seeds
        with (folder / "table.csv").open() as file:
            assert [int(row["seed"]) for row in csv.DictReader(file)] == seeds
        with xr.open_zarr(folder / "store.zarr") as dataset:
            assert dataset["seed"].values.tolist() == seeds
        assert chimera_hpc.open(folder).seed.values.tolist() == seeds


def test_bundle_holds_job_provenance_and_results(
    finished: Path, tmp_path: Path, sweep: Run
) -> None:
    assert sweep("export", finished, "--to", tmp_path / "all.zip")[0] == 0
    with zipfile.ZipFile(tmp_path / "all.zip") as bundle:
        names = set(bundle.namelist())
        assert {"job.json", "table.csv", "results.json", "runs/1.json", "run.log"} <= names
        assert json.loads(bundle.read("job.json"))["name"] == "small"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "x.txt"], "allowed endings are .csv, .nc and .zip"),
        (["--to", "x.csv", "--series"], "--series: only for .nc"),
        (["--to", "none/x.csv"], "can't be written"),
    ],
)
def test_export_refuses_what_it_cannot_write(
    words: list[str], message: str, finished: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(finished.parent)
    before = set(os.listdir())
    code, _, err = sweep("export", finished, *words)
    assert code == 2
    assert message in err
    assert set(os.listdir()) == before


# status


def test_status_counts_points_blocks_and_time(finished: Path, sweep: Run) -> None:
    (finished / "store.zarr" / "ledger" / "c.1.0").unlink()
    os.truncate(finished / "store.zarr" / "ledger" / "c.2.0", 10)
    code, out, _ = sweep("status", finished, "--json")
    state = json.loads(out)
    assert code == 75
    assert (state["points"], state["done"], state["pending"]) == (15, 7, 8)
    assert (state["blocks"], state["blocks_written"], state["blocks_damaged"]) == (4, 2, 1)
    assert state["core_seconds_left"] > 0
    record = finished / "store.zarr" / "runs" / "1.work.json"
    work = json.loads(record.read_text())
    assert work["points"] == 15
    assert state["seconds_a_point"] == pytest.approx(work["core_seconds"] / 15)
    # Measuring and writing take their time, too.
    ledger = Store.open(finished / "store.zarr").ledger()
    assert state["seconds_a_point"] > ledger["elapsed_us"].sum() / 7 / 1e6
    # Version 0.1 left no such record: the points' own times are taken.
    record.write_text("{}")
    old = json.loads(sweep("status", finished, "--json")[1])
    assert old["seconds_a_point"] == pytest.approx(ledger["elapsed_us"].sum() / 7 / 1e6)
    code, out, _ = sweep("status", finished)
    assert "7 of 15 points done (46.7 %)" in out


def test_commands_that_look_write_nothing(finished: Path, sweep: Run) -> None:
    before = contents(finished)
    for words in (["status"], ["why", "P=2"], ["verify", "--stored"]):
        assert sweep(words[0], finished, *words[1:])[0] == 0
    assert contents(finished) == before
