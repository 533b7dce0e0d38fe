"""A sweep with [decide] from the command line: rounds by every executor, and what is said."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.status import Status
from chimera_hpc.classify.atlas import UNCLASSIFIED
from chimera_hpc.classify.classification import TRIPLET, Classification, Cut
from chimera_hpc.cli.cell_map import Cells
from chimera_hpc.job.points import point_keys
from chimera_hpc.plot.boundaries import boundaries_figure
from chimera_hpc.plot.figure_input import FigureInput
from chimera_hpc.reduction.atlases import load_atlas
from chimera_hpc.reduction.decided import tables_of
from chimera_hpc.reduction.export import table
from chimera_hpc.report.content import Content
from chimera_hpc.report.page import page as report_of
from chimera_hpc.store.labelled import open_sweep
from chimera_hpc.store.ledger import read_metadata
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

JOB = {key: value for key, value in SMALL.items() if key != "grid.seeds"} | {
    "grid.P": [2, 5],
    "grid.Q": "0:2",
    "decide.first": 4,
    "decide.batch": 3,
    "decide.most": 10,
    "decide.confidence": 0.9,
    "decide.refine": {"P": 1},
}
FEW = ("Q=0", "decide.first=2", "decide.batch=2", "decide.most=4", "decide.refine={}")
BY_ATLAS = [word for text in (*FEW, 'decide.judge="atlas"') for word in ("--set", text)]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def decided(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("decided")
    (folder / "job.toml").write_text(job_text(JOB))
    words = ["run", str(folder / "job.toml"), "--out", str(folder / "sweep")]
    assert main([*words, "--cluster", "serial", "--no-figures"]) == 0
    return folder


@pytest.fixture(scope="module")
def judged(decided: Path) -> tuple[Path, str]:
    """A sweep beside it that the classes of the first judge, and what its run printed."""
    words = ["run", str(decided / "job.toml"), "--out", str(decided / "judged"), *BY_ATLAS]
    with contextlib.redirect_stdout(io.StringIO()) as said:
        code = main([*words, "--set", 'atlas="sweep"', "--cluster", "serial", "--no-figures"])
    assert code == 0
    return decided / "judged", said.getvalue()


def results(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "results.json").read_bytes())
    return found


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data: dict[str, Any] = json.loads(found.group(1))
    return data


def same(folder: Path, other: Path) -> bool:
    ours, theirs = (Store.open(place / "store.zarr") for place in (folder, other))
    keys = point_keys(ours.points).tolist() == point_keys(theirs.points).tolist()
    digests = ours.ledger()["digest"].tolist() == theirs.ledger()["digest"].tolist()
    return keys and digests and ours.sweep.digest == theirs.sweep.digest


def test_results_hold_cells_and_boundaries(decided):
    found, store = results(decided / "sweep"), Store.open(decided / "sweep" / "store.zarr")
    decide = found["decide"]
    assert decide["rounds"] == len(store.sweeps) > 1
    assert decide["runs"] == store.n_points < decide["full_grid"] == 12 * 10
    assert sum(cell["runs"] for cell in decide["cells"]) == store.n_points
    assert {0.0 <= decide["agreement"][key] <= 1.0 for key in ("runs", "cells")} == {True}
    for cell in decide["cells"]:
        low, high = cell["interval"]
        keys = {"P", "Q", "class", "decided", "runs", "share", "interval", "votes"}
        assert set(cell) == keys
        assert low <= cell["share"] <= high
        assert 4 <= cell["runs"] <= 10
        assert cell["decided"] or cell["runs"] == 10
    classes = {(c["P"], c["Q"]): c["class"] for c in decide["cells"] if c["decided"]}
    for boundary in found["boundaries"]:
        low, high = boundary["interval"]
        ends = [classes[P, boundary["Q"]] for P in (low, high)]
        assert boundary["between"] == ends
        assert ends[0] != ends[1]
        assert boundary["at"] == (low + high) / 2
        if (cross := boundary["crossing"]) is not None:
            assert low <= cross["interval"][0] <= cross["at"] <= cross["interval"][1] <= high
        inner = [P for (P, Q) in classes if boundary["Q"] == Q and low < P < high]
        assert boundary["axis"] == "P"
        assert inner == []


def test_finished_sweep_has_nothing_to_compute(decided, sweep: Run):
    before = results(decided / "sweep")
    words = ("--out", decided / "sweep", "--cluster", "serial", "--no-figures")
    code, out, err = sweep("run", decided / "job.toml", *words)
    assert code == 0
    assert "nothing to compute" in err
    assert "cells at 90 % (" in out
    assert results(decided / "sweep") == before


def test_status_and_plan_tell_rounds_and_runs(decided, sweep: Run, tmp_path):
    decide = results(decided / "sweep")["decide"]
    code, out, _ = sweep("status", decided / "sweep", "--json")
    state = json.loads(out)["decide"]
    assert code == 0
    n_decided = sum(cell["decided"] for cell in decide["cells"])
    assert state == {
        "rounds": decide["rounds"],
        "cells": len(decide["cells"]),
        "decided": n_decided,
        "undecided": len(decide["cells"]) - n_decided,
        "runs": decide["runs"],
        "full_grid": 120,
        "expected_runs": decide["runs"],
    }
    _, out, _ = sweep("status", decided / "sweep")
    assert f"round {decide['rounds']}: {n_decided} of {len(decide['cells'])} cells decided" in out
    _, out, _ = sweep("plan", decided / "job.toml", "--out", tmp_path / "none")
    assert "at best 24 runs, expected unknown before the first round, at worst 120" in out
    _, out, _ = sweep("plan", decided / "job.toml", "--out", decided / "sweep")
    assert f"expected about {decide['runs']}" in out
    _, out, _ = sweep("plan", decided / "job.toml", "--out", tmp_path / "none", "--set", "P=[2]")
    assert "warning: decide.refine.P: P has one value, so no boundary along it" in out


@pytest.mark.slow
def test_shares_do_the_rounds_together(decided, sweep: Run, tmp_path):
    for index in (1, 0):
        words = ("--of", "2", "--index", index, "--out", tmp_path / "sweep")
        code, out, _ = sweep("shard", decided / "job.toml", *words)
        assert code == 0
        assert out == f"share {index} of 2: done\n"
    assert same(tmp_path / "sweep", decided / "sweep")


@pytest.mark.slow
def test_workers_leave_the_same_bits(decided, sweep: Run, tmp_path):
    words = ("--out", tmp_path / "sweep", "--workers", "2", "--no-figures")
    code, _, _ = sweep("run", decided / "job.toml", *words)
    assert code == 0
    assert same(tmp_path / "sweep", decided / "sweep")
    assert results(tmp_path / "sweep")["decide"] == results(decided / "sweep")["decide"]


def test_a_judge_that_is_not_there_is_refused_before_a_point_is_computed(decided, sweep: Run):
    job = ("run", decided / "job.toml", "--cluster", "serial", "--no-figures", *BY_ATLAS)
    code, _, err = sweep(*job, "--out", decided / "lost", "--set", 'atlas="none"')
    assert code == 2
    assert "decide.judge: atlas none: " in err
    code, _, err = sweep(*job, "--out", decided / "lost", "--set", 'atlas="lost"')
    assert code == 2
    assert "decide.judge: atlas lost is this sweep itself" in err
    lost = Store.open(decided / "lost" / "store.zarr").ledger()["status"]
    assert (lost == Status.NEVER).all()
    lost_page = report_of(Content.read(decided / "lost"), most_pictures=0, replay=False)
    assert "decided by the atlas lost, which is not there (yet)" in lost_page
    assert "judge" not in data_of(lost_page)["cuts"]


def test_the_classes_of_another_sweep_may_judge(decided, judged):
    folder, said = judged
    assert "judge: atlas sweep; " in said
    store = Store.open(folder / "store.zarr")
    atlas = load_atlas(decided / "sweep")
    scalars = store.scalars()
    triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
    named = np.array(atlas.classify(triplets).name)
    for cell, rows in zip(results(folder)["decide"]["cells"], (0, 1), strict=True):
        mine = named[(store.points.cells()[0] == rows) & (named != UNCLASSIFIED)].tolist()
        assert cell["runs"] in (2, 4)
        assert cell["class"] == "steady" or mine.count(cell["class"]) == max(map(mine.count, mine))
    rows = list(csv.DictReader("".join(table(store)).splitlines()))
    assert [row["class_judge"] or UNCLASSIFIED for row in rows] == named.tolist()


@pytest.mark.parametrize("name", ["sweep", "judged"])
def test_map_table_page_and_results_show_the_classes_by_which_cells_are_decided(
    decided, judged, sweep: Run, name
):
    folder = decided / name
    cells = results(folder)["decide"]["cells"]
    for cell in cells:
        assert sum(cell["votes"].values()) <= cell["runs"]
        assert cell["class"] in cell["votes"]
    shown = [cell["class"] if cell["decided"] else "undecided" for cell in cells]
    data = data_of(report_of(Content.read(folder), most_pictures=0, replay=False))
    judge = data["cuts"]["judge"]
    looks = [look["name"] for look in judge["looks"]]
    assert [looks[i] for i in judge["modal"]] == [cell["class"] for cell in cells]
    assert data["open"] == [not cell["decided"] for cell in cells]
    found = Cells.read(folder / "store.zarr", read_metadata(folder / "store.zarr"))
    assert found is not None
    assert found.classes == shown
    cuts = [int(k) for k in results(folder)["cuts"]]
    tables = tables_of(results(folder), cuts)
    assert [cell["class"] for cell in tables["decided"]] == shown
    assert list(tables) == ["decided", *map(str, cuts)]
    _, out, _ = sweep("reduce", folder, "--no-figures")
    head = "decided classes" if name == "sweep" else "P  decided  "
    assert any(line.startswith(head) for line in out.splitlines())
    dataset = open_sweep(folder)
    assert dataset.modal_class_judge.values.tolist() == [
        cells[i]["class"] for i in dataset.cell.values
    ]


def test_report_tells_decided_cells(decided):
    page = report_of(Content.read(decided / "sweep"), most_pictures=0, replay=False)
    found = results(decided / "sweep")
    assert "Decided cells and boundaries" in page
    assert f"by {found['decide']['runs']} runs in {found['decide']['rounds']} rounds" in page


def test_figure_has_a_bar_per_boundary_and_open_markers(decided):
    found = results(decided / "sweep")
    cells = found["decide"]["cells"]
    cut = Cut(*[None] * 6)
    axes = [(f"${name}$", [cell[name] for cell in cells]) for name in ("P", "Q")]
    data = FigureInput(Classification(*[cut] * 9), None, axes, {}, decided=found)
    figure = boundaries_figure(data)
    assert figure is not None
    (panel,) = figure.axes
    markers = sum(len(part.get_offsets()) for part in panel.collections if part.get_label())
    assert len(panel.containers) == len(found["boundaries"])
    assert markers >= len(cells)
    line = boundaries_figure(FigureInput(Classification(*[cut] * 9), None, axes[:1], {}))
    assert line is None
