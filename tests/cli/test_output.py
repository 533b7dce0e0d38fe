"""What is printed cannot be written, or no one reads it: one line at most, never a traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from store_tools import make_store

from chimera_hpc.cli.arguments import memory_size

SWEEP = [sys.executable, "-m", "chimera_hpc.sweep"]


def test_full_disk_at_the_output_is_told_on_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*SWEEP, "schema"], stdout=full, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 74
    assert done.stderr == b"error: the output: No space left on device\n"


def test_reader_that_has_read_enough_is_no_error() -> None:
    with subprocess.Popen([*SWEEP, "schema"], stdout=-1, stderr=-1) as process:
        assert process.stdout is not None
        process.stdout.close()
        _, said = process.communicate()
    assert said == b""
    assert process.returncode == 0


def test_watch_ends_when_its_reader_does(tmp_path: Path) -> None:
    make_store(tmp_path)
    words = [*SWEEP, "watch", str(tmp_path), "--every", "3600"]
    with subprocess.Popen(words, stdout=-1, stderr=-1) as process:
        assert process.stdout is not None
        assert b"0 of 15 points" in process.stdout.readline()
        process.stdout.close()
        _, said = process.communicate(timeout=60)
    assert said == b""
    assert process.returncode == 0


@pytest.mark.slow
def test_memory_has_one_option_and_the_old_name_is_read() -> None:
    assert [memory_size(text) for text in ("2G", "800MB", "2gib", "900")] == [
        "2G",
        "800M",
        "2G",
        "900",
    ]
    told = subprocess.run(
        [*SWEEP, "run", "quickstart", "--memory", "1GB", "--workers", "0"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 2
    told = subprocess.run(
        [*SWEEP, "run", "quickstart", "--mem", "2B"], capture_output=True, text=True, check=False
    )
    assert told.returncode == 2
    assert "a size such as 800M or 2G is needed" in told.stderr
