"""The options and markers of conftest.py, seen from a pytest run of their own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def outcome(folder: Path, test: str, *options: str, **environment: str) -> str:
    """Last line that pytest prints for one test file with this project's settings."""
    shutil.copy(ROOT / "tests" / "conftest.py", folder)
    (folder / "test_it.py").write_text(f"import pytest\n{test}", encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    settings = ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder), "test_it.py"]
    done = subprocess.run(
        [*command, *settings, *options],
        capture_output=True,
        text=True,
        cwd=folder,
        env=os.environ | environment,
        check=False,
    )
    return done.stdout.splitlines()[-1]


SLOW = "@pytest.mark.slow\ndef test_it():\n    pass\n"
SLURM = "@pytest.mark.slurm\ndef test_it():\n    pass\n"


HEARD = """
import os, signal, subprocess, sys
def test_it():
    child = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"
    done = subprocess.run([sys.executable, "-c", child], stderr=subprocess.DEVNULL)
    assert done.returncode == -signal.SIGINT
"""


def test_ctrl_c_reaches_what_tests_start_though_it_is_ignored_here(tmp_path: Path) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert outcome(tmp_path, HEARD).startswith("1 passed")
    finally:
        signal.signal(signal.SIGINT, before)


def test_slow_tests_run_only_when_asked_for(tmp_path):
    assert outcome(tmp_path, SLOW).startswith("1 skipped")
    assert outcome(tmp_path, SLOW, "--run-slow").startswith("1 passed")


def test_missing_slurm_skips_unless_it_is_required(tmp_path):
    nowhere = str(tmp_path)
    assert outcome(tmp_path, SLURM, PATH=nowhere, REQUIRE_SLURM="0").startswith("1 skipped")
    assert outcome(tmp_path, SLURM, PATH=nowhere, REQUIRE_SLURM="1").startswith("1 error")


def test_missing_chromium_skips_unless_it_is_required(tmp_path):
    nowhere, test = str(tmp_path), SLURM.replace("slurm", "chromium")
    assert outcome(tmp_path, test, PATH=nowhere, REQUIRE_CHROMIUM="0").startswith("1 skipped")
    assert outcome(tmp_path, test, PATH=nowhere, REQUIRE_CHROMIUM="1").startswith("1 error")


def test_unknown_markers_and_warnings_are_errors(tmp_path):
    unknown = "@pytest.mark.no_such_marker\ndef test_it():\n    pass\n"
    warning = "import warnings\ndef test_it():\n    warnings.warn('careful', stacklevel=1)\n"
    assert outcome(tmp_path, unknown).startswith("1 error")
    assert outcome(tmp_path, warning).startswith("1 failed")
