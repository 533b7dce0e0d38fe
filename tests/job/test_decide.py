"""The tables [decide] and [added] of a job."""

from __future__ import annotations

import numpy as np
import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep
from chimera_hpc.job.points import point_keys

BASE = {key: value for key, value in SMALL.items() if key != "grid.seeds"} | {"grid.Q": "0:P"}
DECIDE = {"decide.confidence": 0.9, "decide.first": 3}


def sweep(**changes):
    return Sweep.from_toml_text(job_text(BASE, DECIDE | changes))


def test_first_seeds_are_those_of_the_grid_and_the_digest_is_that_of_the_grid():
    plain = Sweep.from_toml_text(job_text(BASE, {"grid.seeds": 3}))
    assert sweep().seeds == range(3)
    assert sweep().digest == sweep(**{"decide.most": 7}).digest == plain.digest
    assert Sweep.from_dict(sweep().to_dict()) == sweep()


def test_digest_of_a_job_without_the_tables_is_what_it_was():
    assert Sweep.from_toml_text(job_text(SMALL)).digest == "5e811af9b12433ee"


def test_added_cells_come_behind_the_grid_and_change_the_digest():
    grid = sweep()
    more = sweep(**{"added.P": [3, 5], "added.Q": [2, 5], "added.seeds": [5, 3]})
    assert more.digest != grid.digest
    points = more.points()
    assert (point_keys(points[: len(grid.points())]) == point_keys(grid.points())).all()
    behind = points[len(grid.points()) :]
    rows = [(behind.row(i)["P"], behind.row(i)["Q"], behind.row(i)["seed"]) for i in range(5)]
    assert rows == [(3, 2, 3), (3, 2, 4), (5, 5, 0), (5, 5, 1), (5, 5, 2)]
    assert len(behind) == 5
    assert np.bincount(points.cells()[0]).max() == 5


def test_full_grid_is_refined_everywhere():
    fine = sweep(**{"grid.P": [2, 5], "grid.Q": 2, "decide.refine": {"P": 1}, "decide.most": 10})
    assert fine.decide is not None
    assert fine.decide.full_grid(fine.axes, 2) == 40


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"grid.seeds": 20}, "grid.seeds: 20, but with [decide] every cell has decide.first = 3"),
        ({"decide.most": 2}, "decide.most: 2 is below decide.first = 3"),
        ({"grid.Q": "P", "decide.refine": {"Q": 1}}, "decide.refine.Q: follows P; refine P"),
        ({"decide.refine": {"P": 0.5}}, "decide.refine.P: 0.5 is not an integer"),
        ({"decide.refine": {"p": 1}}, "decide.refine.p: not an axis in [grid]; known: P, Q"),
        ({"decide.refine": {"P": "x"}}, "decide.refine.P: 'x' is not a finite number"),
        ({"decide.refine": {"P": True}}, "decide.refine.P: True is not a finite number"),
        (
            {"grid.b": [0.5, 1.0], "decide.refine": {"b": 1e-300}},
            "decide.refine.b: 1e-300 is below 1e-09 of the axis, 0.5 long",
        ),
        ({"decide.refine": {"P": 0}}, "decide.refine.P: 0 is not above 0"),
        ({"decide.judge": "all"}, "decide.judge = 'all'"),
        ({"decide.judge": "atlas"}, "reduction.atlas names no sweep whose classes judge"),
        ({"added.P": [3], "added.seeds": [3]}, "added.Q: missing"),
        ({"added.P": [3], "added.Q": [2, 3], "added.seeds": [1]}, "must be equally long"),
        ({"added.P": [3, 3], "added.Q": [1, 1], "added.seeds": [1, 2]}, "a cell is there twice"),
        ({"added.P": [9], "added.Q": [1], "added.seeds": [1]}, "added.P: 9 is too large"),
        ({"added.P": [3], "added.Q": [1], "added.seeds": [0]}, "added.seeds: 0 is not a number"),
        ({"added.P": [3], "added.b": [1], "added.Q": [1]}, "added.b: not an axis"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(changes, text):
    with pytest.raises(BadInput) as caught:
        sweep(**changes)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bare_keys_still_mean_the_other_tables():
    assert sweep().model_copy() == sweep()
    made = Sweep.from_toml_text(job_text(BASE), ["refine=sine-fit", "decide.first=4"])
    assert made.features.refine == "sine-fit"
    assert len(made.seeds) == 4
