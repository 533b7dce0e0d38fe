from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from scoreboard import audit
from scoreboard.claims import read_claims
from scoreboard.reproduce import main, write_scoreboard

from chimera_hpc.base.errors import BadInput

ROOT = Path(__file__).parents[2]


def test_an_unknown_job_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--only", "diagonals", "--out", str(tmp_path)]) == 2
    assert "diagonals: not a job of the paper" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("only", "typed"),
    [
        ("typical", "--only diagonal,typical"),
        ("still, robustness-2", "--only diagonal,orientation2,still,robustness-2"),
    ],
)
def test_a_job_names_the_jobs_whose_classes_it_needs(
    only: str, typed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--only", only, "--out", str(tmp_path / "new")]) == 2
    said = capsys.readouterr().err
    assert said.strip().endswith(typed)
    assert said.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_a_job_that_cannot_be_audited_is_said_and_the_others_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def audit_sweep(folder: Path, *args: object, **options: object) -> dict[str, object]:
        if folder.name == "diagonal":
            raise BadInput(f"{folder}: no point has a result yet; there is nothing to audit")
        return {"points": 1, "ways": {}}

    monkeypatch.setattr(audit, "audit_sweep", audit_sweep)
    for name in ("diagonal", "still"):
        (tmp_path / name / "store.zarr").mkdir(parents=True)
    said: list[str] = []
    found = audit.audit_jobs(tmp_path, ("diagonal", "still"), 0.1, 1, said.append)
    assert list(found) == ["still"]
    assert said[0].startswith("audit diagonal: ")
    assert "nothing to audit" in said[0]


def test_judging_an_empty_folder_writes_a_scoreboard(tmp_path: Path) -> None:
    assert main(["--only", "none", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "results.json").read_text())["claims"]
    assert len(rows) >= 40
    assert (tmp_path / "claims.md").read_text().count("not decidable") >= 40


def test_a_call_that_only_judges_keeps_audit_and_times(tmp_path: Path) -> None:
    cost = {"jobs": 19, "minutes": 31.4, "cpu_minutes": 55.1, "processors": 2, "load": 2.0}
    made = {"schema": 1, "quick": False, "claims": [], "audit": {}, "seconds": {"plane": 9.0}}
    write_scoreboard(tmp_path, made | {"cost": cost})
    assert main(["--only", "none", "--out", str(tmp_path)]) == 0
    results = json.loads((tmp_path / "results.json").read_text())
    assert (results["cost"], results["seconds"]) == (cost, {"plane": 9.0})
    text = (tmp_path / "claims.md").read_text()
    assert "in 31 minutes of wall time on 2 processors" in text
    assert "\n\n\n" not in text


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_thinned_reproduction_ends_well_and_keeps_the_claims_that_survive(
    tmp_path: Path,
) -> None:
    command = [sys.executable, "-P", "-m", "scoreboard.reproduce", "--quick"]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "jobs/paper")])
    }
    ended = subprocess.run(
        [*command, "--out", str(tmp_path), "--workers", "2"],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    results = json.loads((tmp_path / "results.json").read_text())
    outcome = {row["id"]: (row["outcome"], row["measured"]) for row in results["claims"]}
    wanted = [claim.id for claim in read_claims(ROOT / "jobs/paper/claims.toml") if claim.quick]
    lost = {name: outcome[name] for name in wanted if outcome[name][0] != "reproduced"}
    assert len(wanted) >= 20
    assert lost == {}
    assert results["audit"]["diagonal"]["points"] >= 1
    assert results["cost"]["cpu_minutes"] > 0.1
    diagonal = json.loads((tmp_path / "diagonal" / "results.json").read_text())
    assert diagonal["audit"] == results["audit"]["diagonal"]
    assert "Audit of the labels" in (tmp_path / "claims.md").read_text()
