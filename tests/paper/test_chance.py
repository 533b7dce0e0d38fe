"""Claims judged again with the seeds of every cell drawn with replacement."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scoreboard.chance import RedrawnEvidence, Runs
from scoreboard.evidence import Missing
from scoreboard.rules import cells_are

from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.job.shipped import jobs_folder

CENTRES = {"ordered": (0.05, 0.01, 0.0), "chimera": (0.3, 0.1, 0.1), "disordered": (0.6, 0.02, 0.0)}


def made_runs(votes: list[dict[str, int]]) -> Runs:
    """Runs of the diagonal, 10 in each cell from P = 3 on, of the classes that `votes` counts."""
    job = jobs_folder() / "paper" / "diagonal.toml"
    sweep = Sweep.load(job, [f"P=3:{2 + len(votes)}", "seeds=10"])
    names = [name for cell in votes for name, count in cell.items() for _ in range(count)]
    rng = np.random.default_rng(1)
    triplets = np.array([CENTRES[name] for name in names]) + 1e-3 * rng.random((len(names), 3))
    scalars = dict(zip(("V_theta", "V_a", "V_Omega"), triplets.T, strict=True))
    scalars["sigma_1"] = triplets[:, 0]
    return Runs(sweep, sweep.points(), np.full(len(names), int(Status.DONE)), scalars)


@pytest.fixture
def runs() -> Runs:
    """Three clear cells, and one where 6 of 10 runs are chimeras."""
    clear = [{name: 10} for name in CENTRES]
    return made_runs([*clear, {"chimera": 6, "ordered": 4}])


def test_every_drawn_run_comes_from_its_own_cell(runs: Runs) -> None:
    drawn = runs.drawn(np.random.default_rng(3))
    for cell in runs.cells:
        assert set(drawn.scalars["V_a"][cell]) <= set(runs.scalars["V_a"][cell])
    assert (drawn.scalars["V_a"] != runs.scalars["V_a"]).any()


def test_clear_cells_keep_their_class_and_an_open_one_changes_as_often_as_its_votes_say(
    runs: Runs, tmp_path: Path
) -> None:
    clear = [{"P": 3, "class": "ordered"}, {"P": 4, "class": "chimera"}]
    open_cell = [{"P": 6, "class": "chimera"}]
    held = []
    for draw in range(100):
        evidence = RedrawnEvidence(tmp_path, {"diagonal": runs}, draw)
        assert cells_are(evidence, "diagonal", 3, clear).outcome == "reproduced"
        held.append(cells_are(evidence, "diagonal", 3, open_cell).outcome == "reproduced")
    # 10 draws with p = 0.6: at least 6 chimeras in 63 %, a tie in 20 %.
    assert 0.55 < np.mean(held) < 0.9


def test_same_draw_gives_the_same_results(runs: Runs, tmp_path: Path) -> None:
    first, second = (RedrawnEvidence(tmp_path, {"diagonal": runs}, 5) for _ in range(2))
    for path in ("cuts", "clustering", "curves/variations"):
        assert first.value("diagonal", path) == second.value("diagonal", path)


def test_results_of_a_draw_are_made_when_they_are_looked_at(runs: Runs, tmp_path: Path) -> None:
    evidence = RedrawnEvidence(tmp_path, {"diagonal": runs}, 5)
    made = evidence.job("diagonal")
    assert not made["curves"]
    evidence.value("diagonal", "curves/variations/cells")
    assert list(made["curves"]) == ["variations"]
    assert "cuts" not in made
    assert len(evidence.cells("diagonal", 3)) == 4
    assert list(made["curves"]) == ["variations"]
    for path in ("curves/stability", "curves/no_such", "no_such"):
        with pytest.raises(Missing, match=path):
            evidence.value("diagonal", path)


def test_job_that_was_not_run_is_missing(tmp_path: Path) -> None:
    with pytest.raises(Missing, match="diagonal has not been run"):
        RedrawnEvidence(tmp_path, {}, 0).job("diagonal")
