"""Causes of claims that do not reproduce: the file, and how chance enters."""

from __future__ import annotations

from pathlib import Path

import pytest
from scoreboard.causes import cause_text, explain, read_causes
from scoreboard.claims import read_claims

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.shipped import jobs_folder

PAPER = jobs_folder() / "paper"


def test_file_names_claims_that_exist_and_known_kinds() -> None:
    claims = read_claims(PAPER / "claims.toml")
    causes = read_causes(PAPER / "causes.toml", [claim.id for claim in claims])
    assert len(causes) >= 30
    assert all(cause.found for cause in causes.values())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('claims = ["a"]\nkind = "luck"\nfound = "x"', "kind 'luck'; known: chance"),
        ('claims = ["b"]\nkind = "chance"\nfound = "x"', "b is no claim"),
        ('claims = ["a"]\nkind = "chance"', "the keys of a cause are claims, kind, found"),
    ],
)
def test_malformed_cause_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "causes.toml"
    path.write_text(f"[[cause]]\n{text}\n")
    with pytest.raises(BadInput, match=says):
        read_causes(path, ["a"])


@pytest.mark.parametrize(
    ("holds", "kind"), [(9, "convention"), (10, "chance"), (200, "chance"), (0, "convention")]
)
def test_five_percent_of_the_redrawn_sweeps_make_it_chance(holds: int, kind: str) -> None:
    causes = read_causes(PAPER / "causes.toml", _ids())
    found = explain(
        "b-6",
        causes,
        {"default": {"holds": 0, "of": 200}, "paper-printed": {"holds": holds, "of": 200}},
    )
    assert found["kind"] == kind
    counted = f"{kind}: holds in 0 of 200 (default), {holds} of 200 (paper-printed) redrawn sweeps"
    assert cause_text(found).startswith(f"{counted}. At b = 1.7, 97 of 100 seeds go")


def test_claim_without_a_cause_is_said_to_be_unexplained() -> None:
    assert cause_text(explain("x", {}, {})) == "unexplained"
    assert cause_text(None) == ""


def _ids() -> list[str]:
    return [claim.id for claim in read_claims(PAPER / "claims.toml")]
