from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scoreboard.audit import compare, labels_of, variants
from scoreboard.audit_figures import audit_figure, draw_audit
from scoreboard.audit_text import cells_table, chimeras_line, jobs_table
from scoreboard.cells import audit_cells, resample, share_of, total_variation

from chimera_hpc.job import Sweep


def test_audit_counts_changes_and_moves() -> None:
    found = compare(["ordered", "chimera", "chimera", "steady"], ["ordered"] * 2 + ["chimera"] * 2)
    assert (found["changed"], found["share"]) == (2, 0.5)
    assert found["moves"] == {"chimera to ordered": 1, "steady to chimera": 1}
    assert found["net"] == {"ordered": 0.25, "steady": -0.25}
    assert total_variation(found["net"]) == 0.25


def test_a_basin_is_audited_by_inside_and_outside() -> None:
    status, none = np.array([1, 2]), np.full((2, 3), np.nan)
    found = labels_of(None, status, none, np.array([0.2, 0.7]), np.array([0.5, 0.5]))
    assert found == ["inside", "outside"]


def test_the_ways_to_run_again_change_what_they_say_and_nothing_else() -> None:
    sweep = Sweep.from_dict({"name": "a", "model": "topological_fhn", "grid": {"P": 3, "Q": 3}})
    points = sweep.points()
    made = variants(sweep, points, ("tighter", "moved", "late"))
    assert made["tighter"][0].integrator.rtol == pytest.approx(1e-5)
    assert made["tighter"][0].integrator.atol == pytest.approx(1e-8)
    assert made["tighter"][1] is points
    assert made["moved"][1].columns["delta"][0] - 1e-3 == pytest.approx(1e-13, rel=1e-3)
    assert made["moved"][0].integrator == sweep.integrator
    assert made["late"][0].integrator.t_end == 5000.0
    assert made["late"][0].features.start == 4950.0


def test_bootstrap_of_a_unanimous_cell_is_certain_and_of_a_split_one_is_not() -> None:
    rng = np.random.default_rng(0)
    size = {"ordered": 100, "chimera": 50}
    assert resample({"chimera": 20}, "chimera", size, rng) == (1.0, 1.0, 1.0)
    # P(X >= 10) for X ~ B(20, 1/2): half of the votes is enough for the larger class.
    half = resample({"ordered": 10, "chimera": 10}, "ordered", size, rng)
    assert half.stays == pytest.approx(0.588, abs=0.06)
    # The middle 95 % of B(20, 1/2) / 20 goes from 6 to 14.
    assert (half.low, half.high) == pytest.approx((0.3, 0.7), abs=0.051)


def test_bootstrap_counts_steady_as_ordered_and_leaves_out_runs_without_a_window() -> None:
    votes = {"steady": 3, "ordered-2": 1, "no_window": 6}
    found = resample(votes, "ordered", {"ordered-2": 1}, np.random.default_rng(0))
    assert found == (1.0, 1.0, 1.0)
    assert share_of(votes, "ordered") == 1.0
    assert np.isnan(share_of({"no_window": 6}, None))


@pytest.fixture
def audited() -> dict[str, Any]:
    """P = Q = 3 and 4 with three seeds; two runs of 3 audited, one changed at tighter tolerance."""
    grid = {"P": [3, 4], "Q": "P", "seeds": 3}
    points = Sweep.from_dict({"name": "a", "model": "topological_fhn", "grid": grid}).points()
    labels = ["ordered", "chimera", "ordered", "chimera", "chimera", "chimera"]
    again = {"tighter": ["ordered", "ordered"], "moved": ["ordered", "chimera"]}
    rng = np.random.default_rng(0)
    cells = audit_cells(points, labels, np.array([0, 1]), again, rng)
    before = ["ordered", "chimera"]
    return {
        "points": 2,
        "of": 6,
        "classes": {"ordered": 1, "chimera": 1},
        "axes": [{"name": "P", "symbol": "$P = Q$"}],
        **{way: compare(before, after) for way, after in again.items()},
        "cells": cells,
        "bootstrap": {"cells": 2, "mean": 0.9, "below_95": 1, "expected_changes": 0.2},
    }


def test_cells_hold_votes_class_audited_points_and_the_changes_of_each_way(audited) -> None:
    first, second = audited["cells"]
    assert (first["P"], first["Q"], first["votes"]) == (3, 3, {"ordered": 2, "chimera": 1})
    assert (first["class"], first["audited"]) == ("ordered", 2)
    assert first["tighter"]["net"] == {"chimera": -0.5, "ordered": 0.5}
    assert first["tighter"]["moves"] == {"chimera to ordered": 1}
    assert first["moved"] == {"changed": 0, "net": {}, "moves": {}}
    assert 0.5 < first["stays"] < 1.0
    assert (second["class"], second["audited"], second["stays"]) == ("chimera", 0, 1.0)
    assert "tighter" not in second


def test_cells_without_an_audited_point_can_be_left_out() -> None:
    grid = {"P": [3, 4], "Q": "P", "seeds": 1}
    points = Sweep.from_dict({"name": "a", "model": "topological_fhn", "grid": grid}).points()
    rng = np.random.default_rng(0)
    cells = audit_cells(points, ["ordered"] * 2, np.array([1]), {}, rng, every=False)
    assert [cell["P"] for cell in cells] == [4]


def test_tables_give_each_job_a_row_and_each_cell_that_changed(audited) -> None:
    jobs = jobs_table({"diagonal": audited}).splitlines()
    assert len(jobs) == 3
    assert "| 2 of 6 | 1 (0.09 to 0.91): chimera -0.500, ordered +0.500 | 0 (0.00 to " in jobs[2]
    rows = cells_table({"diagonal": audited}).splitlines()[2:]
    assert len(rows) == 1
    assert "| P = 3, Q = 3 | 2 | 1 chimera to ordered | 0 |  | ordered, 0." in rows[0]


def test_chimeras_that_became_something_else_are_counted_over_all_jobs(audited) -> None:
    moves = {"changed": 1, "net": {}, "moves": {"chimera-2 to ordered": 2, "ordered to chimera": 1}}
    audit = {"a": audited | {"late": moves}, "basin": audited}
    assert chimeras_line(audit) == (
        "Of 1 audited chimeras these had another class: 1 (100x tighter tolerance), "
        "0 (moved by 1e-13 (control)), 2 (t = 5000).\n"
    )


def test_figure_shows_the_share_with_its_bar_over_the_changes(audited, tmp_path: Path) -> None:
    figure = audit_figure(audited)
    assert figure is not None
    upper, lower = figure.axes
    bars = {float(box.lines[0].get_xdata()[0]): box for box in upper.containers}
    assert bars[3.0].lines[0].get_ydata() == pytest.approx(2 / 3)
    found = {line.get_label(): np.asarray(line.get_ydata()).tolist() for line in lower.lines}
    assert found == {"100x tighter tolerance": [0.5], "moved by 1e-13 (control)": [0.0]}
    assert len(draw_audit(tmp_path, {"diagonal": audited})) == 2
    assert (tmp_path / "diagonal/figures/audit.png").stat().st_size > 1000


def test_figure_over_two_axes_has_a_panel_for_the_bootstrap_and_one_for_each_way(audited) -> None:
    axes = [{"name": "P", "symbol": "$P$"}, {"name": "Q", "symbol": "$Q$"}]
    figure = audit_figure(audited | {"axes": axes})
    assert figure is not None
    titles = [panel.get_title(loc="left") for panel in figure.axes[:3]]
    assert titles[0] == "(a)  bootstrap: class stays"
    assert titles[2] == "(c)  moved by 1e-13 (control)"
    assert audit_figure(audited | {"axes": []}) is None
