"""Memory of the machine or of the groups that this process is in, shared among workers."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from chimera_hpc.base import memory

GB = 2**30


@pytest.mark.parametrize(
    ("groups", "files", "expected"),
    [
        ("0::/", {"memory.max": "max"}, None),
        ("0::/", {"memory.max": f"{GB}"}, GB),
        ("0::/job/step", {"job/memory.max": f"{GB}", "job/step/memory.max": "max"}, GB),
        ("5:cpu:/x\n4:memory:/job", {"memory/job/memory.limit_in_bytes": f"{GB}"}, GB),
        ("4:memory:/not/seen/here", {"memory/memory.limit_in_bytes": f"{2**63 - 4096}"}, None),
        ("5:cpu:/x", {"memory.max": f"{GB}"}, None),
        ("", {}, None),
    ],
)
def test_smallest_limit_of_machine_and_groups(
    groups: str,
    files: dict[str, str],
    expected: int | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    membership = tmp_path / "membership"
    membership.write_text(groups)
    monkeypatch.setattr(memory, "_CGROUPS", tmp_path)
    monkeypatch.setattr(memory, "_MEMBERSHIP", membership)
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    assert memory.usable_memory() == (expected or machine)
    assert memory.share_of_memory(4) == (expected or machine) // 4


def test_system_without_groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_MEMBERSHIP", tmp_path / "none")
    assert memory.usable_memory() > 0
