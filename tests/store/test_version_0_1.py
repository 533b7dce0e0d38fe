"""A store that version 0.1 wrote opens, verifies, resumes and extends.

The archive holds a sweep of eight points with four results: version 0.1 computed two seeds of P = 3
and 4, then `extend` added two more. Version 0.1 gave the digests below to all eight.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc.base.status import Status
from chimera_hpc.cli.main import main
from chimera_hpc.store.labelled import open_sweep
from chimera_hpc.store.store import Store

ARCHIVE = Path(__file__).parents[1] / "data" / "store-0.1.zip"
SETTINGS = [
    word
    for setting in (
        "P=3:4",
        "integrator.t_end=60.0",
        "integrator.t_step=0.05",
        "features.start=40.0",
        "features.n_peaks=4",
        "features.n_overlap=1",
        "keep.series=first-seed",
    )
    for word in ("--set", setting)
]
DIGESTS = {
    (3, 0): -7288794522362431241,
    (3, 1): 5762946228430470439,
    (3, 2): 2738435900635284336,
    (3, 3): -6865925356740221510,
    (4, 0): 5390793299823076474,
    (4, 1): -4385761019825528770,
    (4, 2): -1762981936393165905,
    (4, 3): -6597285398140627161,
}


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    with zipfile.ZipFile(ARCHIVE) as archive:
        archive.extractall(tmp_path)
    return tmp_path


def digests(folder: Path) -> dict[tuple[int, int], int]:
    store = Store.open(folder / "store.zarr")
    ledger, columns = store.ledger(), store.points.columns
    return {
        (int(columns["P"][i]), int(columns["seed"][i])): int(ledger["digest"][i])
        for i in range(store.n_points)
        if ledger["status"][i] != Status.NEVER
    }


def test_it_opens_with_its_settings_under_the_new_names(sweep: Path) -> None:
    store = Store.open(sweep / "store.zarr")
    assert store.sweep.features.n_overlap == 1
    assert store.sweep.features.steady_threshold == 1e-2
    assert store.status()[Status.NEVER] == 4


def test_its_results_are_computed_again_to_the_same_bits(
    sweep: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(sweep), "--sample", "1.0"]) == 0
    assert "4 of 4 points" in capsys.readouterr().out


def test_it_resumes_and_keeps_what_it_has(sweep: Path) -> None:
    before = digests(sweep)
    words = ["run", "quickstart", *SETTINGS, "--set", "seeds=4", "--out", str(sweep)]
    assert main([*words, "--cluster", "serial", "--no-figures"]) == 0
    after = digests(sweep)
    assert before.items() <= after.items()
    assert after == DIGESTS


def test_it_has_no_quality_and_merges_with_a_store_that_has(sweep: Path, tmp_path: Path) -> None:
    store = Store.open(sweep / "store.zarr")
    assert np.isnan(store.quality()["r_squared"]).all()
    assert "samples_per_period" not in open_sweep(sweep)
    words = ["run", "quickstart", *SETTINGS, "--set", "seeds=[7]", "--out", str(tmp_path / "new")]
    assert main([*words, "--cluster", "serial", "--no-figures"]) == 0
    merged = ["merge", str(sweep), str(tmp_path / "new"), "--out", str(tmp_path / "all")]
    assert main(merged) in (0, 75)
    found = Store.open(tmp_path / "all" / "store.zarr")
    known = np.isfinite(found.quality()["samples_per_period"])
    assert found.points.columns["seed"][known].tolist() == [7]  # P = 3 is steady
    assert "samples_per_period" in open_sweep(tmp_path / "all")


def test_it_extends(sweep: Path) -> None:
    words = [*SETTINGS, "--set", "seeds=5", "--out", str(sweep)]
    assert main(["extend", "quickstart", *words]) == 0
    assert Store.open(sweep / "store.zarr").n_points == 10
    assert len(digests(sweep)) == 4


def test_it_is_reduced_and_exported(sweep: Path) -> None:
    assert main(["reduce", str(sweep), "--no-figures"]) == 0
    assert (sweep / "results.json").is_file()
    assert main(["export", str(sweep), "--to", str(sweep / "table.csv")]) == 0
    assert "V_theta" in (sweep / "table.csv").read_text(encoding="utf-8")
