from __future__ import annotations

import inspect
from pathlib import Path

import pytest
from scoreboard.claims import markdown, read_claims, scoreboard, summary
from scoreboard.evidence import Evidence
from scoreboard.plan import JOBS, QUICK, load
from scoreboard.rules import RULES

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep

FOLDER = Path(__file__).parents[2] / "jobs" / "paper"
CLAIMS = read_claims(FOLDER / "claims.toml")


def test_there_are_at_least_forty_claims_with_ids_places_and_rules() -> None:
    assert len(CLAIMS) >= 40
    assert all(c.id and c.where and c.says and c.rule and c.command for c in CLAIMS)


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.id)
def test_arguments_of_a_claim_fit_its_rule(claim) -> None:
    inspect.signature(RULES[claim.check]).bind(Evidence("nowhere"), **claim.args)


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.id)
def test_a_claim_asks_for_jobs_that_exist(claim) -> None:
    jobs = [claim.args.get(key) for key in ("job", "first", "second")]
    assert {job for job in jobs if isinstance(job, str)} <= set(JOBS)


def test_every_job_file_is_in_the_plan_and_every_job_has_a_file() -> None:
    files = {path.stem for path in FOLDER.glob("*.toml")} - {"claims", "causes"}
    assert files == set(JOBS)
    assert set(QUICK) <= set(JOBS)


@pytest.mark.parametrize("name", JOBS)
@pytest.mark.parametrize("quick", [False, True])
def test_a_job_loads_and_plans(name: str, quick: bool) -> None:
    sweep = load(name, FOLDER, quick)
    assert sweep.name == name
    assert len(sweep.points()) >= 1
    if quick:
        assert len(sweep.points()) <= 150


def test_a_job_comes_after_those_whose_atlas_it_asks_for() -> None:
    for place, name in enumerate(JOBS):
        reduction = load(name, FOLDER).reduction
        assert set((*reduction.atlas, *reduction.beside)) <= set(JOBS[:place])


def test_the_experiments_have_the_sizes_of_the_paper() -> None:
    sizes = {name: len(Sweep.load(FOLDER / f"{name}.toml").points()) for name in JOBS}
    assert sizes["diagonal"] == 460
    assert sizes["plane"] == 6380
    assert sizes["basin"] == sizes["basin-200"] == 30_000
    assert sizes["networked"] == 110


def test_without_any_result_no_claim_of_a_job_can_be_decided(tmp_path: Path) -> None:
    chosen = [claim for claim in CLAIMS if claim.check != "orientation_without_effect"]
    rows = scoreboard(chosen, Evidence(tmp_path))
    assert {row["reproduced"] for row in rows} == {None}
    assert summary(rows).startswith(f"{len(chosen)} claims: 0 reproduced, 0 not reproduced")
    assert markdown(rows).count("\n") == len(rows) + 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[claim]]\nid = "a"\ncheck = "nothing"', "no rule nothing"),
        ('[[claim]]\nid = "a"\ncheck = "number"\nfoo = 1', "unknown keys foo"),
    ],
)
def test_a_malformed_claim_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "claims.toml").write_text(text)
    with pytest.raises(BadInput, match=message):
        read_claims(tmp_path / "claims.toml")
