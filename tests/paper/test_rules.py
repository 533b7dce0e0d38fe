from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scoreboard.evidence import Evidence, Missing, family_of, select, wanted
from scoreboard.rules import NOT_REPRODUCED, REPRODUCED, RULES

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


def test_a_selection_takes_integers_exactly_and_fractions_within_a_few_ulps() -> None:
    rows = [{"seed": 2**62}, {"seed": 2**62 + 1}]
    assert select(rows, {"seed": 2**62 + 1}) == rows[1:]
    with pytest.raises(Missing):
        select(rows, {"seed": 2**62 + 2})
    fractions = [{"b": 0.1 + 0.2}, {"b": 0.3 + 1e-9}]
    assert select(fractions, {"b": 0.3}) == fractions[:1]


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
