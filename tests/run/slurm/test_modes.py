"""Three ways to run a sweep on a cluster: one store, the same bits."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from slurm_real import Slurm
from slurm_sweeps import LONG, digests, logs, n_done, rows_done, sweep, write_job

from chimera_hpc.run.slurm import tls
from chimera_hpc.store.ledger import read_ledger

pytestmark = pytest.mark.slurm

ROOT = Path(__file__).parents[3]


@pytest.mark.slow
def test_an_array_gives_the_serial_digests_and_is_reduced(
    slurm: Slurm, serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("slurm", job, "--out", out, "--mode", "array", "--submit")
    assert done.returncode == 0, done.stderr
    slurm.wait()
    np.testing.assert_array_equal(digests(out), digests(serial), err_msg=logs(out))
    assert (out / "results.json").is_file()


@pytest.mark.slow
def test_an_allocation_gives_the_serial_digests(slurm: Slurm, serial: Path, tmp_path: Path) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("slurm", job, "--out", out, "--mode", "allocation", "--submit")
    assert done.returncode == 0, done.stderr
    slurm.wait()
    np.testing.assert_array_equal(digests(out), digests(serial), err_msg=logs(out))
    assert slurm.exit_code(done.stdout.split()[2]) == 0
    assert not list((tmp_path / "private").iterdir())


@pytest.mark.slow
def test_worker_jobs_give_the_serial_digests(slurm: Slurm, serial: Path, tmp_path: Path) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("run", job, "--out", out, "--cluster", "slurm", "--no-figures")
    assert done.returncode == 0, done.stderr + logs(out)
    np.testing.assert_array_equal(digests(out), digests(serial))
    assert "ssh -N -L" in done.stderr
    assert not list((tmp_path / "private").iterdir())


@pytest.mark.slow
def test_a_driver_in_a_job_of_its_own_gives_the_serial_digests(
    slurm: Slurm, serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep("slurm", job, "--out", out, "--mode", "jobqueue", "--submit")
    assert done.returncode == 0, done.stderr
    slurm.wait()
    np.testing.assert_array_equal(digests(out), digests(serial), err_msg=logs(out))
    assert slurm.exit_code(done.stdout.split()[2]) == 0
    assert "2 worker jobs asked for" in (out / "run.log").read_text()
    assert not list((tmp_path / "private").iterdir())


def ways(out: Path) -> set[str]:
    """Return in which ways the points of a store were computed, as the records of its runs tell."""
    found = set()
    for number in set(read_ledger(out / "store.zarr")["run"].tolist()):
        run = json.loads((out / "store.zarr" / "runs" / f"{number}.json").read_text())
        job = "an array" if "SLURM_ARRAY_JOB_ID" in run["slurm"] else "an allocation"
        found.add(job if run["slurm"] else "a laptop")
    return found


@pytest.mark.slow
def test_a_sweep_goes_from_an_array_to_an_allocation_to_a_laptop(
    slurm: Slurm, long_serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONG), tmp_path / "out"
    words = ("slurm", job, "--out", out, "--no-reduce", "--submit", "--mode")
    array = sweep(*words, "array").stdout.split()[2]
    slurm.until(lambda: n_done(out) >= 8, 180, "8 points are not done")
    slurm.sh("scancel", "--signal=USR1", "--full", array)
    slurm.wait(60)
    assert n_done(out) < 32
    # One that was told before its program ran has nothing to say.
    assert 75 in {slurm.exit_code(f"{array}_{i}") for i in range(4)}
    sweep(*words, "allocation")
    slurm.until(lambda: n_done(out) >= 32, 180, "32 points are not done")
    cancelled = sweep("cancel", out).stdout
    assert "cancelled job" in cancelled
    assert "removed the certificate" in cancelled
    slurm.wait(60)
    assert not list(tls.home().iterdir())
    before = rows_done(out)
    assert len(before) < 64
    done = sweep("run", job, "--out", out, "--cluster", "serial", "--no-figures")
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(digests(out), digests(long_serial))
    after = rows_done(out)
    assert {i: after[i] for i in before} == before
    assert ways(out) == {"an array", "an allocation", "a laptop"}


@pytest.mark.slow
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
