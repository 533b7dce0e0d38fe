"""The options and markers of conftest.py, seen from two pytest runs of their own."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TESTS = {
    "slow": "@pytest.mark.slow\ndef test_it():\n    pass\n",
    "slurm": "@pytest.mark.slurm\ndef test_it():\n    pass\n",
    "chromium": "@pytest.mark.chromium\ndef test_it():\n    pass\n",
    "unknown": "@pytest.mark.no_such_marker\ndef test_it():\n    pass\n",
    "warning": "import warnings\ndef test_it():\n    warnings.warn('careful', stacklevel=1)\n",
    "heard": """
import os, signal, subprocess, sys
def test_it():
    child = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"
    done = subprocess.run([sys.executable, "-c", child], stderr=subprocess.DEVNULL)
    assert done.returncode == -signal.SIGINT
""",
}


def outcomes(folder: Path, *options: str, **environment: str) -> dict[str, str]:
    """What pytest says of each of `TESTS`, with this project's settings and no program in reach."""
    shutil.copy(ROOT / "tests" / "conftest.py", folder)
    for name, test in TESTS.items():
        (folder / f"test_{name}.py").write_text(f"import pytest\n{test}", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider"]
    settings = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder), str(folder)]
    done = subprocess.run(
        [*command, *settings, "--continue-on-collection-errors", *options],
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | {"PATH": str(folder)} | environment,
        check=False,
    )
    found = re.findall(r"^([A-Z]+)(?: \[1\])? test_(\w+)\.py", done.stdout, re.MULTILINE)
    return {name: word for word, name in found}


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Without options, where Chromium is required and Ctrl-C is ignored."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        needs = {"REQUIRE_SLURM": "0", "REQUIRE_CHROMIUM": "1"}
        return outcomes(tmp_path_factory.mktemp("quick"), **needs)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """With the slow tests, where Slurm is required."""
    needs = {"REQUIRE_SLURM": "1", "REQUIRE_CHROMIUM": "0"}
    return outcomes(tmp_path_factory.mktemp("whole"), "--run-slow", **needs)


def test_ctrl_c_reaches_what_tests_start_though_it_is_ignored_here(quick: dict[str, str]) -> None:
    assert quick["heard"] == "PASSED"


def test_slow_tests_run_only_when_asked_for(quick: dict[str, str], whole: dict[str, str]) -> None:
    assert (quick["slow"], whole["slow"]) == ("SKIPPED", "PASSED")


def test_missing_programs_skip_unless_they_are_required(
    quick: dict[str, str], whole: dict[str, str]
) -> None:
    assert (quick["slurm"], whole["slurm"]) == ("SKIPPED", "ERROR")
    assert (quick["chromium"], whole["chromium"]) == ("ERROR", "SKIPPED")


def test_unknown_markers_and_warnings_are_errors(quick: dict[str, str]) -> None:
    assert (quick["unknown"], quick["warning"]) == ("ERROR", "FAILED")
