from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chimera_hpc.grid import Sweep
from chimera_hpc.paper.audit import compare, labels_of, modal_stays, variants
from chimera_hpc.paper.evidence import Evidence, Missing, family_of, select, wanted
from chimera_hpc.paper.rules import NOT_REPRODUCED, REPRODUCED, RULES

COUNTS = ("total", "done", "steady", "no_window", "failed", "pending")


@pytest.fixture
def evidence(tmp_path: Path):
    """Write results of jobs and return them as evidence."""

    def make(**jobs: Any) -> Evidence:
        for name, results in jobs.items():
            (tmp_path / name).mkdir()
            whole = {"schema": 1, "sweep": name, "cuts": {}, "curves": {}, "claims": []} | results
            whole["points"] = dict.fromkeys(COUNTS, 0) | results.get("points", {})
            (tmp_path / name / "results.json").write_text(json.dumps(whole))
        return Evidence(tmp_path)

    return make


def cells(**classes: str) -> dict[str, Any]:
    """Cut of three with a cell P = number for each entry P12="chimera"."""
    sizes = [{"name": n, "size": s} for n, s in (("ordered", 9), ("chimera", 5), ("disordered", 7))]
    rows = [{"P": int(n[1:]), "class": c, "votes": {c: 4}} for n, c in classes.items()]
    return {"cuts": {"3": {"clusters": sizes, "cells": rows, "depth": 2.0}}}


def test_steady_votes_count_as_ordered_and_ties_go_to_the_larger_class() -> None:
    size = {"ordered-1": 3, "ordered-2": 3, "chimera": 5}
    assert family_of({"steady": 2, "ordered-2": 2, "chimera": 3}, size) == "ordered"
    assert family_of({"ordered-1": 2, "chimera": 2}, size) == "ordered"
    assert family_of({"no_window": 3}, size) is None


def test_a_selection_of_an_absent_value_is_missing() -> None:
    rows = [{"P": 3, "epsilon": 0.1}, {"P": 4, "epsilon": 0.2}]
    assert wanted("3:5") == [3, 4, 5]
    assert select(rows, {"P": "3:4"}) == rows
    assert select(rows, {"epsilon": {"above": 0.15}}) == rows[1:]
    with pytest.raises(Missing, match="P = 5"):
        select(rows, {"P": "3:5"})


def test_cells_are_counts_cells_and_names_the_wrong_ones(evidence) -> None:
    found = evidence(job=cells(P2="steady", P3="ordered", P12="chimera", P13="disordered"))
    expect = [{"P": [2, 3], "class": "ordered"}, {"P": [12, 13], "class": "chimera"}]
    verdict = RULES["cells_are"](found, "job", 3, expect)
    assert verdict.outcome == NOT_REPRODUCED
    assert verdict.measured == "3 of 4: P = 13 is disordered"
    assert verdict.low < 0.75 < verdict.high
    assert RULES["cells_are"](found, "job", 3, expect, at_least=3).outcome == REPRODUCED


def test_only_there_looks_outside_the_named_values(evidence) -> None:
    found = evidence(job=cells(P12="chimera", P14="disordered", P16="chimera"))
    assert RULES["only_there"](found, "job", 3, "P", "11:13", "chimera").outcome == NOT_REPRODUCED
    assert RULES["only_there"](found, "job", 3, "P", "11:16", "chimera").outcome == REPRODUCED


@pytest.mark.parametrize(
    ("bounds", "holds"),
    [({"at_least": 2.0}, True), ({"above": 2.0}, False), ({"at_most": 1.9}, False)],
)
def test_number_respects_each_bound(evidence, bounds: dict[str, float], holds: bool) -> None:
    found = evidence(job={"curves": {"a": [{"b": 2.0}]}})
    verdict = RULES["number"](found, "job", "curves/a/0/b", **bounds)
    assert (verdict.outcome == REPRODUCED) is holds


def test_an_unfinished_job_is_missing(evidence) -> None:
    found = evidence(job={"points": {"pending": 3}})
    with pytest.raises(Missing, match="not finished"):
        RULES["number"](found, "job", "points/pending")


def test_transition_is_the_middle_of_the_last_change(evidence) -> None:
    rows = [
        {"P": 12, "epsilon": e, "votes": {c: 10}}
        for e, c in ((0.01, "chimera"), (0.02, "ordered"), (0.04, "chimera"), (0.05, "chimera"))
    ]
    found = evidence(job={"curves": {"atlas": {"judges": {"x": rows}}}})
    verdict = RULES["transition"](found, "job", {"P": 12}, "chimera", 0.02, 0.05)
    assert (verdict.outcome, verdict.measured) == (REPRODUCED, "epsilon = 0.03")
    never = RULES["transition"](found, "job", {"P": 12}, "ordered", 0.02, 0.05)
    assert never.outcome == NOT_REPRODUCED


def test_share_of_chimeras_pools_the_stretch_and_checks_every_value(evidence) -> None:
    curve = {"x": [0, 5, 10], "hits": [10, 10, 8], "trials": [10, 10, 10], "half_at": None}
    entry = {"judge": "own", "by": {"own": curve}}
    found = evidence(job={"curves": {"robustness": entry}})
    rule = RULES["share_of_chimeras"]
    assert rule(found, "job", flips=0, until=5, at_least=1.0).outcome == REPRODUCED
    verdict = rule(found, "job", flips=0, until=10, at_least=1.0)
    assert verdict.outcome == NOT_REPRODUCED
    assert verdict.measured.startswith("28 of 30")
    with pytest.raises(Missing, match="no 7 reversed"):
        rule(found, "job", flips=7)


def test_printed_values_are_held_against_the_middle_95_percent(evidence) -> None:
    row = {"P": 9, "runs": 20, "V_a": [0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06]}
    found = evidence(job={"curves": {"variations": {"cells": [row]}}})
    rule = RULES["triplet"]
    assert rule(found, "job", {"P": 9}, [0.05], ["V_a"]).outcome == REPRODUCED
    assert rule(found, "job", {"P": 9}, [0.055], ["V_a"]).outcome == NOT_REPRODUCED


def test_audit_counts_changes_and_moves() -> None:
    found = compare(["ordered", "chimera", "chimera", "steady"], ["ordered"] * 2 + ["chimera"] * 2)
    assert (found["changed"], found["share"]) == (2, 0.5)
    assert found["moves"] == {"chimera to ordered": 1, "steady to chimera": 1}
    assert found["net"] == {"chimera": 0.0, "ordered": 0.25, "steady": -0.25}


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
    assert modal_stays({"chimera": 20}, "chimera", size, rng) == 1.0
    # P(X <= 10) for X ~ B(20, 1/2): half of the votes is enough for the larger class.
    half = modal_stays({"ordered": 10, "chimera": 10}, "ordered", size, rng)
    assert half == pytest.approx(0.588, abs=0.06)
