"""Three ways to run a sweep on a cluster: one store, the same bits."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from slurm_real import Slurm
from slurm_sweeps import digests, logs, sweep, write_job

pytestmark = pytest.mark.slurm

ROOT = Path(__file__).parents[2]


def test_an_array_gives_the_serial_digests_and_is_reduced(
    slurm: Slurm, serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("slurm", job, "--out", out, "--mode", "array", "--submit")
    assert done.returncode == 0, done.stderr
    slurm.wait()
    np.testing.assert_array_equal(digests(out), digests(serial), err_msg=logs(out))
    assert (out / "results.json").is_file()


def test_an_allocation_gives_the_serial_digests(slurm: Slurm, serial: Path, tmp_path: Path) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("slurm", job, "--out", out, "--mode", "allocation", "--submit")
    assert done.returncode == 0, done.stderr
    slurm.wait()
    np.testing.assert_array_equal(digests(out), digests(serial), err_msg=logs(out))
    assert slurm.exit_code(done.stdout.split()[2]) == 0
    assert not list((tmp_path / "private").iterdir())


def test_worker_jobs_give_the_serial_digests(slurm: Slurm, serial: Path, tmp_path: Path) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("run", job, "--out", out, "--cluster", "slurm", "--no-figures")
    assert done.returncode == 0, done.stderr + logs(out)
    np.testing.assert_array_equal(digests(out), digests(serial))
    assert "ssh -N -L" in done.stderr
    assert not list((tmp_path / "private").iterdir())


def test_the_templates_run_a_sweep(
    slurm: Slurm, serial: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "jobs").mkdir()
    write_job(tmp_path, block=32).rename(tmp_path / "jobs" / "quickstart.toml")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    template = ROOT / "jobs" / "slurm"
    words = ("sbatch", "--parsable", "--export=ALL")
    # Two blocks are the shares 0 and 1 of the sixteen.
    array = slurm.sh(*words, "--array=0-1", str(template / "array.sbatch"), cwd=tmp_path)
    after = f"--dependency=afterany:{array}"
    slurm.sh(*words, after, str(template / "reduce.sbatch"), cwd=tmp_path)
    slurm.wait()
    out = tmp_path / "results" / "quickstart"
    np.testing.assert_array_equal(digests(out), digests(serial))
    assert (out / "results.json").is_file()
