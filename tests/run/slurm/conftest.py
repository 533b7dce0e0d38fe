"""One real SLURM for all tests here."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from slurm_real import Slurm
from slurm_sweeps import LONG, sweep, write_job


@pytest.fixture(scope="session")
def slurm_session() -> Iterator[Slurm]:
    started = Slurm()
    yield started
    started.stop()


@pytest.fixture
def slurm(slurm_session: Slurm, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Slurm]:
    monkeypatch.setenv("SLURM_CONF", str(slurm_session.conf))
    monkeypatch.setenv("CHIMERA_HPC_PRIVATE", str(tmp_path / "private"))
    # The kernels that the tests around have compiled.
    kernels = Path.home() / ".cache" / "chimera_hpc" / "numba"
    monkeypatch.setenv("NUMBA_CACHE_DIR", os.environ.get("NUMBA_CACHE_DIR", str(kernels)))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    yield slurm_session
    slurm_session.drain()


@pytest.fixture(scope="session")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the small sweep computed by one process."""
    return _by_one_process(write_job(tmp_path_factory.mktemp("serial")))


@pytest.fixture(scope="session")
def long_serial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the sweep with long runs computed by one process."""
    return _by_one_process(write_job(tmp_path_factory.mktemp("long"), LONG))


def _by_one_process(job: Path) -> Path:
    out = job.with_name("out")
    done = sweep("run", job, "--out", out, "--cluster", "serial", "--no-figures")
    assert done.returncode == 0, done.stderr
    return out
