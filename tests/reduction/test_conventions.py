"""Triplets of a second convention: measured by the task, reduced and audited next to the first."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.job.registry import DEFAULT_PANEL
from chimera_hpc.measures.conventions import PRESETS
from chimera_hpc.measures.fourier import measure_signals
from chimera_hpc.measures.variation import total_variations
from chimera_hpc.recordings.judge import Judge
from chimera_hpc.reduction.audit import Sample, audit_sweep
from chimera_hpc.reduction.conventions import conventions, stored_reduction
from chimera_hpc.reduction.reduction import reduce_sweep
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

JOB = job_text(SMALL, {"grid.P": "1:4", "reduction.figures": []})
BOTH = "measures.panel=" + json.dumps([*DEFAULT_PANEL, "paper-printed"])


def run(folder: Path, *settings: str) -> Path:
    folder.mkdir()
    (folder / "job.toml").write_text(JOB)
    words = [word for text in settings for word in ("--set", text)]
    place = ["--out", str(folder / "sweep"), "--cluster", "serial", "--no-figures"]
    assert main(["run", str(folder / "job.toml"), *place, *words]) == 0
    return folder / "sweep"


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(tmp_path_factory.mktemp("both") / "a", BOTH)


def results(folder: Path) -> dict:
    return json.loads((folder / "results.json").read_text())


def test_the_second_triplet_is_that_of_the_stored_series(both: Path) -> None:
    store = Store.open(both / "store.zarr")
    assert conventions(store.sweep) == ("", "paper-printed")
    scalars, step = store.scalars(), store.sweep.integrator.t_step
    for i in range(store.n_points):
        u = store.series(i)
        t = 30.0 + step * np.arange(len(u))
        found = measure_signals(t, u, n_peaks=3, n_overlap=1, **PRESETS["paper-printed"])
        stored = [scalars[f"V_{name}_printed"][i] for name in ("theta", "a", "Omega")]
        assert stored == pytest.approx(total_variations(found), abs=1e-9)
        assert scalars["status_printed"][i] == found.status


def test_exports_hold_all_measures_and_the_classes_under_both(both: Path) -> None:
    store = Store.open(both / "store.zarr")
    for name in ("table.csv", "sweep.nc"):
        assert main(["export", str(both), "--to", str(both / name)]) == 0
    with (both / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    with xr.open_dataset(both / "sweep.nc") as data:
        for name, values in store.scalars().items():
            np.testing.assert_array_equal(data[name], values)
            if name != "status_printed":
                found = [float(row[name] or "nan") for row in rows]
                np.testing.assert_array_equal(found, values)
        for suffix, folder in (("", ""), ("_printed", "paper-printed")):
            stored = stored_reduction(both, folder)
            for cut in stored.attributes["cuts"]:
                name, labels = f"class_{cut}{suffix}", stored.arrays[f"labels_{cut}"]
                names = [*stored.attributes[f"names_{cut}"], ""]
                assert [row[name] for row in rows] == [names[max(k, -1)] for k in labels]
                among = data[name].values[labels >= 0].astype(str)
                assert among.tolist() == [names[k] for k in labels if k >= 0]
    words = {row["status_printed"] for row in rows}
    assert words <= {status.name.lower() for status in Status}


def test_all_runs_are_clustered_under_it_and_the_first_results_stay(
    both: Path, tmp_path: Path
) -> None:
    first, second = results(both), results(both / "paper-printed")
    assert second["clustering"]["clustered_points"] == 20
    assert first["clustering"]["clustered_points"] == first["points"]["done"] < 20
    alone = results(run(tmp_path / "b"))
    assert {key: first[key] for key in alone} == alone


def test_every_line_stands_below_the_name_of_its_convention(both: Path) -> None:
    lines: list[str] = []
    reduce_sweep(both, make_figures=False, say=lines.append)
    second = lines.index("convention of the job:")
    assert lines[0] == "convention paper-printed:"
    assert sum("points run" in line for line in lines[:second]) == 1
    assert sum("points run" in line for line in lines[second:]) == 1


@pytest.mark.slow
def test_a_job_with_the_preset_has_the_classes_of_the_second_convention(
    both: Path, tmp_path: Path
) -> None:
    sweep = run(tmp_path / "b", "features.preset=paper-printed")
    one, other = stored_reduction(sweep), stored_reduction(both, "paper-printed")
    assert one.arrays["labels_3"].tolist() == other.arrays["labels_3"].tolist()
    votes = [
        [cell["votes"] for cell in results(folder)["cuts"]["3"]["cells"]]
        for folder in (sweep, both / "paper-printed")
    ]
    assert votes[0] == votes[1]


def test_an_audit_compares_the_labels_of_both(both: Path) -> None:
    audit_sweep(both, Sample(points=2), ways=("nudged",))
    one, other = results(both)["audit"], results(both / "paper-printed")["audit"]
    assert one["points"] == other["points"] == 2
    assert one["key"] != other["key"]


def test_recordings_are_judged_under_the_second_convention(both: Path, tmp_path: Path) -> None:
    judge = Judge.load(both, "paper-printed")
    assert judge.settings.window_reference == "own"
    assert len(judge.atlas.points) == 20
    alone = run(tmp_path / "b")
    with pytest.raises(BadInput, match=r"--preset paper-printed: the runs of .* were not measured"):
        Judge.load(alone, "paper-printed")


@pytest.mark.slow
def test_recordings_are_not_judged_by_default_under_the_second_convention(tmp_path: Path) -> None:
    printed = run(tmp_path / "a", "features.preset=paper-printed")
    with pytest.raises(BadInput, match=r'\[features\] preset = "default" is needed$'):
        Judge.load(printed, "default")


def test_the_panel_belongs_to_the_digest() -> None:
    sweep = Sweep.from_toml_text(JOB)
    assert Sweep.from_toml_text(JOB, [BOTH]).digest != sweep.digest
