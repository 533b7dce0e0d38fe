"""The audit of the paper's jobs, as text."""

from __future__ import annotations

from typing import Any

import pytest
from scoreboard.audit_text import audit_text, chimeras_line, jobs_table, points_table

from chimera_hpc.classify.resampling import compare_labels


@pytest.fixture
def audited() -> dict[str, Any]:
    """Two points of six computed again; one changed at tighter tolerance and over a longer run."""
    before = ["ordered", "chimera"]
    again = {"tighter": ["ordered"] * 2, "nudged": before, "longer": ["ordered", "steady"]}
    place = {"P": 3, "Q": 3, "seed": 1}
    point = {"point": 1, "place": place, "label": "chimera"}
    return {
        "points": 2,
        "total": 6,
        "classes": {"ordered": 1, "chimera": 1},
        "ways": {way: compare_labels(before, after)._asdict() for way, after in again.items()},
        "changed": [point | {"tighter": "ordered", "nudged": "chimera", "longer": "steady"}],
        "bootstrap": {"cells": 2, "mean": 0.9, "loose": [{"kept": 0.8}]},
    }


def test_tables_give_each_job_and_each_changed_point_a_row(audited: dict[str, Any]) -> None:
    jobs = jobs_table({"diagonal": audited}).splitlines()
    assert len(jobs) == 3
    assert "| 2 of 6 | 1 (0.09 to 0.91): chimera -0.500, ordered +0.500 | 0 (0.00 to " in jobs[2]
    assert jobs[2].endswith("| 0.900 over 2 cells, 1 below 0.9 |")
    (row,) = points_table({"diagonal": audited}).splitlines()[2:]
    words = "| diagonal | P = 3, Q = 3, seed = 1 | chimera | ordered | chimera | steady |"
    assert row == words


def test_chimeras_that_became_something_else_are_counted_over_all_jobs(
    audited: dict[str, Any],
) -> None:
    basin = audited | {"ways": {"tighter": audited["ways"]["tighter"]}}
    assert chimeras_line({"a": audited, "b": audited, "basin": basin}) == (
        "Of 2 audited chimeras these had another class: 2 (100x tighter tolerance), "
        "0 (moved by 1e-13 (control)), 2 (t = 5000).\n"
    )
    assert "2 % of all points" in audit_text({"a": audited})
