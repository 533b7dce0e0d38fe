"""Where results come from."""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from chimera_hpc.store import provenance
from chimera_hpc.store.provenance import differences, gather, git_state, package_digest


def test_a_run_says_who_where_when_with_what() -> None:
    info = json.loads(json.dumps(gather()))
    assert info["process"] == os.getpid()
    assert info["libraries"]["zarr"]
    assert info["machine"]["cpu"]
    assert len(info["source"]) == 16
    assert info["started"].endswith("+00:00")
    assert {"package", "git", "python", "user", "command", "folder", "slurm"} <= set(info)


def test_gathering_is_quick() -> None:
    package_digest.cache_clear()
    began = time.process_time()
    gather()
    assert time.process_time() - began < 0.3


def test_slurm_variables_are_taken_and_no_others(monkeypatch: Any) -> None:
    monkeypatch.setenv("SLURM_JOB_ID", "17")
    monkeypatch.setenv("SLURM_JWT", "secret")
    assert gather()["slurm"] == {"SLURM_JOB_ID": "17"}


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "chimera_hpc").mkdir()
    (tmp_path / "chimera_hpc" / "a.py").write_text("1\n")
    (tmp_path / "notes").write_text("1\n")
    identity = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    for command in (["init", "-q"], ["add", "."], [*identity, "commit", "-qm", "x"]):
        subprocess.run(["git", "-C", str(tmp_path), *command], check=True)
    return tmp_path


def test_git_state_is_the_commit_and_whether_the_package_differs_from_it(checkout: Path) -> None:
    head = ["git", "-C", str(checkout), "rev-parse", "HEAD"]
    commit = subprocess.run(head, capture_output=True, text=True, check=True).stdout.strip()
    (checkout / "notes").write_text("2\n")
    assert git_state(checkout) == {"commit": commit, "dirty": False}
    (checkout / "chimera_hpc" / "b.py").write_text("1\n")
    assert git_state(checkout) == {"commit": commit, "dirty": True}
    (checkout / "chimera_hpc" / "b.py").unlink()
    (checkout / "chimera_hpc" / "a.py").write_text("2\n")
    assert git_state(checkout) == {"commit": commit, "dirty": True}


def test_outside_a_checkout_or_without_git_there_is_no_commit(
    checkout: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    inside = checkout / "chimera_hpc"
    assert git_state(inside) is None
    monkeypatch.setenv("PATH", str(inside))
    assert git_state(checkout) is None


def test_package_digest_follows_the_code(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(provenance, "PACKAGE", tmp_path)
    digests = []
    for name, text in (("a.py", "1"), ("a.py", "2"), ("b.py", ""), ("b.txt", "")):
        (tmp_path / name).write_text(text)
        package_digest.cache_clear()
        digests.append(package_digest())
    package_digest.cache_clear()
    assert len(set(digests)) == 3
    assert digests[2] == digests[3]


def test_differences_name_what_may_change_numbers() -> None:
    before = gather()
    now = json.loads(json.dumps(before))
    now.update(user="eve", source="0", folder="/")
    now["libraries"]["numpy"] = "9.9"
    now["machine"].update(cpu="Other", host="elsewhere")
    assert differences(before, before) == []
    lines = differences(before, now)
    assert [line.partition(":")[0] for line in lines] == ["source", "numpy", "cpu"]
    assert lines[2] == f"cpu: {before['machine']['cpu']} before, Other now"
