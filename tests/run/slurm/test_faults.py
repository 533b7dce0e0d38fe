"""What SLURM may do to jobs in the middle of a sweep: blocks in flight are all that is lost."""

from __future__ import annotations

import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from slurm_real import Slurm
from slurm_sweeps import LONG, command, digests, logs, n_done, rows_done, sweep, write_job

from chimera_hpc.run.slurm import tls
from chimera_hpc.store.claims import live_claims

pytestmark = [pytest.mark.slurm, pytest.mark.slow]

WORKERS = 2


@contextmanager
def driver(job: Path, out: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """Run a sweep with worker jobs in a process of its own."""
    words = command("run", job, "--out", out, "--cluster", "slurm", "--no-figures", *more)
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def wait_for_points(out: Path, at_least: int, slurm: Slurm) -> None:
    slurm.until(
        lambda: (out / "store.zarr").is_dir() and n_done(out) >= at_least, 180, "no points are done"
    )


def assert_whole(out: Path, reference: Path, before: dict[int, tuple[int, ...]]) -> None:
    """Every point is done and right, and none that was done at the time of `before` was redone."""
    after = rows_done(out)
    assert len(after) == 64
    assert {i: after[i] for i in before} == before
    np.testing.assert_array_equal(digests(out), digests(reference))


def worker_jobs(slurm: Slurm) -> list[str]:
    return [number for number, state, _ in slurm.queue() if state == "RUNNING"]


def cancel_all(slurm: Slurm) -> None:
    slurm.sh("scancel", *worker_jobs(slurm))


def requeue_one(slurm: Slurm) -> None:
    slurm.sh("scontrol", "requeue", worker_jobs(slurm)[0])


def node_down(slurm: Slurm) -> None:
    node = slurm.sh("squeue", "-h", "-t", "R", "-o", "%N").split()[0]
    slurm.sh("scontrol", "update", f"nodename={node}", "state=down", "reason=test")


def preempt(slurm: Slurm) -> None:
    jobs = worker_jobs(slurm)
    options = ("-p", "urgent", "--exclusive", "-N2", "-o", "/dev/null", "--wrap", "true")
    slurm.sh("sbatch", *options)
    slurm.until(
        lambda: any(int(slurm.told(job, "Restarts")) for job in jobs), 20, "none was preempted"
    )


@pytest.mark.parametrize("strike", [cancel_all, requeue_one, node_down, preempt])
def test_a_lost_worker_costs_its_blocks_only(
    strike: Callable[[Slurm], None], slurm: Slurm, long_serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONG), tmp_path / "out"
    with driver(job, out) as process:
        wait_for_points(out, 8, slurm)
        before, in_flight = rows_done(out), live_claims(out / "store.zarr")
        strike(slurm)
        assert n_done(out) < 64, "the strike came too late to be one"
        said, _ = process.communicate(timeout=240)
    assert process.returncode == 0, said
    assert len(in_flight) <= WORKERS
    assert_whole(out, long_serial, before)


def test_a_killed_driver_is_cleared_up_after_and_started_again(
    slurm: Slurm, long_serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONG), tmp_path / "out"
    with driver(job, out) as process:
        wait_for_points(out, 4, slurm)
        process.kill()
        process.wait()
        assert list(tls.home().iterdir())
        cleared = sweep("cancel", out)
    assert cleared.returncode == 0, cleared.stderr
    assert "removed the certificate" in cleared.stdout
    assert not list(tls.home().iterdir())
    slurm.wait(60)
    before = rows_done(out)
    assert len(before) < 64
    with driver(job, out) as process:
        said, _ = process.communicate(timeout=240)
    assert process.returncode == 0, said
    assert_whole(out, long_serial, before)


def test_ctrl_c_stops_in_good_order(slurm: Slurm, tmp_path: Path) -> None:
    job, out = write_job(tmp_path, LONG), tmp_path / "out"
    with driver(job, out) as process:
        wait_for_points(out, 4, slurm)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "to go on:" in said
    slurm.wait(60)


def test_an_array_element_that_failed_is_submitted_again(
    slurm: Slurm, long_serial: Path, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONG), tmp_path / "out"
    words = ("slurm", job, "--out", out, "--mode", "array", "--no-reduce", "--submit")
    number = sweep(*words).stdout.split()[2]
    wait_for_points(out, 4, slurm)
    # scancel itself may die of SIGPIPE when the element ends before it has answered.
    slurm.sh("scancel", "--signal=11", "--full", f"{number}_1", check=False)
    slurm.wait()
    assert slurm.told(f"{number}_1", "JobState") == "FAILED"
    before = rows_done(out)
    assert 0 < len(before) < 64
    slurm.sh("sbatch", "--array=1", str(out / "slurm" / "array.sbatch"))
    slurm.wait()
    assert_whole(out, long_serial, before)


POINT_SECONDS, JOB_SECONDS = 0.25, 15
"""A job ends before the 64 points can be done, however fast the machine is."""
NEAR = ("--time", "1", "--drain", f"{60 - JOB_SECONDS}")


@pytest.fixture
def unhurried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Return a job whose points take their time, and its folder when one process did it at once."""
    monkeypatch.syspath_prepend(tmp_path)
    shutil.copy(Path(__file__).parents[2] / "faults" / "trouble.py", tmp_path)
    job = write_job(tmp_path, model="trouble:MODEL")
    alone = sweep(*("run", job, "--out", tmp_path / "alone", "--cluster", "serial", "--no-figures"))
    assert alone.returncode == 0, alone.stderr
    monkeypatch.setenv("TROUBLE_SECONDS", str(POINT_SECONDS))
    return job, tmp_path / "alone"


def test_a_job_near_its_limit_says_that_there_is_more_to_do_and_the_next_one_ends_the_sweep(
    slurm: Slurm, unhurried: tuple[Path, Path], tmp_path: Path
) -> None:
    (job, alone), out = unhurried, tmp_path / "out"
    words = ("slurm", job, "--out", out, "--mode", "array", "--no-reduce", "--submit")
    number = sweep(*words, "--array", "1", *NEAR).stdout.split()[2]
    slurm.wait()
    before = rows_done(out)
    assert len(before) < 64
    assert slurm.exit_code(number) == 75
    assert slurm.told(number, "RunTime") < "00:01:00"
    number = sweep(*words, "--array", "2").stdout.split()[2]
    slurm.wait()
    assert [slurm.exit_code(f"{number}_{i}") for i in (0, 1)] == [0, 0]
    assert_whole(out, alone, before)


def test_a_job_near_its_limit_goes_on_as_the_same_job_until_the_sweep_is_reduced(
    slurm: Slurm, unhurried: tuple[Path, Path], tmp_path: Path
) -> None:
    (job, alone), out = unhurried, tmp_path / "out"
    words = ("slurm", job, "--out", out, "--mode", "array", "--resubmit", "9", "--submit")
    number = sweep(*words, "--array", "1", *NEAR).stdout.split()[2]
    slurm.wait()
    assert "goes on later: 1 of 9" in logs(out)
    assert slurm.told(number, "Restarts") != "0"
    assert_whole(out, alone, {})
    assert (out / "results.json").is_file()
