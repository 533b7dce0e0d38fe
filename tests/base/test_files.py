"""Files that are whole or absent."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from chimera_hpc.base import files
from chimera_hpc.base.files import (
    remove_leftovers,
    temporary_name,
    write_atomically,
    write_together,
)


def test_a_failed_write_leaves_the_old_contents_and_nothing_else(
    tmp_path: Path, monkeypatch: Any
) -> None:
    path = tmp_path / "a"
    write_atomically(path, b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a"]


def test_files_written_together_appear_in_their_order(tmp_path: Path, monkeypatch: Any) -> None:
    replace, seen = os.replace, []

    def second_fails(source: Path, target: Path) -> None:
        seen.append(Path(target).name)
        if len(seen) == 2:
            raise OSError(5, "Input/output error")
        replace(source, target)

    monkeypatch.setattr(os, "replace", second_fails)
    with pytest.raises(OSError, match="Input/output"):
        write_together([(tmp_path / name, b"x") for name in "abc"])
    assert seen == ["a", "b"]
    assert os.listdir(tmp_path) == ["a"]


def test_contents_are_flushed_before_the_name_and_the_folder_after(
    tmp_path: Path, monkeypatch: Any
) -> None:
    events = []
    replace, fsync = os.replace, os.fsync

    def note_sync(descriptor: int) -> None:
        events.append("folder" if os.path.isdir(f"/proc/self/fd/{descriptor}") else "contents")
        fsync(descriptor)

    def note_rename(source: Path, target: Path) -> None:
        events.append("name")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", note_sync)
    monkeypatch.setattr(os, "replace", note_rename)
    write_atomically(tmp_path / "a", b"1")
    assert events == ["contents", "name", "folder"]


def test_temporary_names_tell_their_process_and_never_repeat(tmp_path: Path) -> None:
    names = {temporary_name(tmp_path / "c.0.0").name for _ in range(100)}
    assert len(names) == 100
    assert all(f"-{os.getpid()}-" in name and name.startswith(".c.0.0.") for name in names)


def test_leftovers_may_be_folders(tmp_path: Path) -> None:
    folder = tmp_path / temporary_name(tmp_path / "store.zarr").name.replace(
        f"-{os.getpid()}-", "-4194303-"
    )
    (folder / "u").mkdir(parents=True)
    kept = temporary_name(tmp_path / "store.zarr")
    kept.mkdir()
    assert remove_leftovers(tmp_path) == 1
    assert list(tmp_path.iterdir()) == [kept]
    assert remove_leftovers(tmp_path / "missing") == 0


def test_create_exclusively_creates_once(tmp_path: Path) -> None:
    assert files.create_exclusively(tmp_path / "a", b"1")
    assert not files.create_exclusively(tmp_path / "a", b"2")
    assert (tmp_path / "a").read_bytes() == b"1"
    assert os.listdir(tmp_path) == ["a"]


def test_server_time_is_the_clock_that_stamps_files(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("time.time", lambda: 0.0)
    path = tmp_path / "a"
    path.touch()
    assert abs(files.server_time(tmp_path) - path.stat().st_mtime) < 5
    assert os.listdir(tmp_path) == ["a"]


SKEWED = """
import sys, time
real = time.time
time.time = lambda: real() + float(sys.argv[2])
from pathlib import Path
from chimera_hpc.base.files import remove_leftovers, time_at
print(remove_leftovers(Path(sys.argv[1])), time_at(Path(sys.argv[1])) - real())
"""


@pytest.mark.parametrize("ahead", [3700.0, 1e9, -1e9])
def test_machine_with_a_wrong_clock_deletes_no_fresh_file(tmp_path: Path, ahead: float) -> None:
    fresh, folder = temporary_name(tmp_path / "c.0.0"), temporary_name(tmp_path / "store.zarr")
    fresh.touch()
    folder.mkdir()
    old = tmp_path / f".c.1.0.other-1-1.0123abcd{files._SUFFIX}"
    old.touch()
    os.utime(old, (0, time.time() - files.LEFTOVER_AGE - 60))
    words = [sys.executable, "-c", SKEWED, str(tmp_path), str(ahead)]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
    assert said[0] == "1"
    assert abs(float(said[1])) < 60
    assert sorted(tmp_path.iterdir()) == sorted([fresh, folder])


def test_without_a_place_to_write_no_file_seems_older_than_it_is(
    tmp_path: Path, monkeypatch: Any
) -> None:
    (tmp_path / "a").touch()
    os.utime(tmp_path / "a", (5, 5))
    (tmp_path / "b").touch()
    os.utime(tmp_path / "b", (7, 7))

    def full(path: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "touch", full)
    assert files.time_at(tmp_path) == 7
    assert files.time_at(tmp_path / "missing") == 0
