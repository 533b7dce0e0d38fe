"""Finished sweeps to try commands on."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.sweep import main

JOB = job_text(SMALL)


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """The job file of 15 small points: P = Q = 2 to 4 with 5 seeds each, in blocks of 4."""
    file = tmp_path / "job.toml"
    file.write_text(JOB)
    return file


@pytest.fixture(scope="session")
def _finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    (folder / "job.toml").write_text(JOB)
    words = ["run", str(folder / "job.toml"), "--out", str(folder / "sweep")]
    assert main([*words, "--cluster", "serial", "--no-figures"]) == 0
    return folder / "sweep"


@pytest.fixture
def finished(_finished: Path, tmp_path: Path) -> Path:
    """The folder of that sweep, finished; a copy for each test."""
    return shutil.copytree(_finished, tmp_path / "sweep")


@pytest.fixture
def sweep(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command line; return its exit status and what it printed."""

    def run(*words: object) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(word) for word in words])
        output = capsys.readouterr()
        return code, output.out, output.err

    return run
