"""Each fault in the harness, in worker processes and in one process; see ``scripts/faults``."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
pytestmark = [pytest.mark.faults, pytest.mark.slow, pytest.mark.timeout(1200)]


def fault_names() -> list[str]:
    """Return the names of the faults, without importing what the harness needs."""
    text = (FOLDER / "faults.py").read_text()
    return re.findall(r'^    (?:Strike|Surroundings|Culprit|Damage|Story)\("(.*?)",', text, re.M)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Run the harness once, in a process that has no threads."""
    folder = tmp_path_factory.mktemp("faults")
    command = [sys.executable, str(FOLDER / "__main__.py"), "--brief", "--jobs", "6"]
    options = ["--folder", str(folder), "--json", str(folder / "rows.json")]
    path = os.pathsep.join(filter(None, [str(FOLDER), str(ROOT), os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(
        [*command, *options], env=environment, capture_output=True, text=True, check=False
    )
    assert (folder / "rows.json").exists(), done.stdout + done.stderr
    return {row["fault"]: row for row in json.loads((folder / "rows.json").read_text())}


def test_there_are_faults_of_every_kind() -> None:
    assert len(fault_names()) == len(set(fault_names())) == 33


@pytest.mark.parametrize("name", fault_names())
def test_no_point_is_lost(name: str, rows: dict[str, dict[str, Any]]) -> None:
    row = rows[name]
    if row["impossible"]:
        pytest.skip(row["impossible"])
    assert row["problems"] == []
    assert row["lost"] == 0
    assert row["trials"] == row["equal"] == row["planned"]
    assert row["recomputed"] <= row["allowed"]
