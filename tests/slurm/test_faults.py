"""What SLURM may do to jobs in the middle of a sweep: blocks in flight are all that is lost."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from slurm_real import Slurm
from slurm_sweeps import command, n_done, sweep, write_job

from chimera_hpc.slurm import tls

pytestmark = [pytest.mark.slurm, pytest.mark.faults]

LONG, LONGER = 3000.0, 10000.0
"""Times of runs that let a sweep last for some five seconds on two cores, or for twenty."""
WORKERS, BLOCK = 2, 4


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
        lambda: (out / "store.zarr").is_dir() and n_done(out) >= at_least, 60, "no points are done"
    )


def recomputed(out: Path) -> int:
    """Return how many points were computed more than once, as the log of the run tells."""
    done = re.findall(r"block \d+: (\d+) done", (out / "run.log").read_text())
    return sum(map(int, done)) - 64


def worker_jobs(slurm: Slurm) -> list[str]:
    return [number for number, state, _ in slurm.queue() if state == "RUNNING"]


def cancel_all(slurm: Slurm) -> None:
    slurm.sh("scancel", *worker_jobs(slurm))


def requeue_one(slurm: Slurm) -> None:
    slurm.sh("scontrol", "requeue", worker_jobs(slurm)[0])


def node_down(slurm: Slurm) -> None:
    node = slurm.sh("squeue", "-h", "-t", "R", "-o", "%N").split()[0]
    slurm.sh("scontrol", "update", f"nodename={node}", "state=down", "reason=test")


@pytest.mark.parametrize("strike", [cancel_all, requeue_one, node_down])
def test_a_lost_worker_costs_its_blocks_only(
    strike: Callable[[Slurm], None], slurm: Slurm, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONG, BLOCK), tmp_path / "out"
    with driver(job, out) as process:
        wait_for_points(out, 8, slurm)
        strike(slurm)
        said, _ = process.communicate(timeout=120)
    assert process.returncode == 0, said
    assert n_done(out) == 64
    assert recomputed(out) <= WORKERS * BLOCK


def test_a_killed_driver_is_cleared_up_after_and_the_sweep_finished(
    slurm: Slurm, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONG, BLOCK), tmp_path / "out"
    with driver(job, out) as process:
        wait_for_points(out, 4, slurm)
        process.kill()
        process.wait()
        assert list(tls.home().iterdir())
        cleared = sweep("cancel", out)
    assert cleared.returncode == 0, cleared.stderr
    assert "removed the certificate" in cleared.stdout
    assert not list(tls.home().iterdir())
    slurm.wait(20)
    done = sweep("run", job, "--out", out, "--cluster", "local", "--workers", "2", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert n_done(out) == 64


def test_ctrl_c_stops_in_good_order(slurm: Slurm, tmp_path: Path) -> None:
    job, out = write_job(tmp_path, LONG, BLOCK), tmp_path / "out"
    with driver(job, out) as process:
        wait_for_points(out, 4, slurm)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=40)
    assert process.returncode == 130, said
    assert "to go on:" in said
    slurm.wait(10)


def test_a_cancelled_array_element_is_submitted_again(slurm: Slurm, tmp_path: Path) -> None:
    job, out = write_job(tmp_path, LONG, BLOCK), tmp_path / "out"
    words = ("slurm", job, "--out", out, "--mode", "array", "--no-reduce", "--submit")
    number = sweep(*words).stdout.split()[2]
    wait_for_points(out, 4, slurm)
    slurm.sh("scancel", f"{number}_1")
    slurm.wait()
    assert n_done(out) < 64
    slurm.sh("sbatch", "--array=1", str(out / "slurm" / "array.sbatch"))
    slurm.wait()
    assert n_done(out) == 64


def test_a_job_at_its_time_limit_goes_on_as_the_same_job(slurm: Slurm, tmp_path: Path) -> None:
    job, out = write_job(tmp_path, LONGER, BLOCK), tmp_path / "out"
    limits = ("--array", "1", "--time", "1", "--drain", "50", "--no-reduce")
    words = ("slurm", job, "--out", out, "--mode", "array", *limits, "--resubmit", "1", "--submit")
    began = time.monotonic()
    number = sweep(*words).stdout.split()[2]
    log = out / "slurm" / "shard-0.log"
    slurm.until(lambda: "goes on later" in _job_logs(out), 50, "the job did not drain")
    assert time.monotonic() - began < 55
    assert 0 < n_done(out) < 64
    assert log.is_file()
    slurm.sh("scancel", number)
    slurm.wait(20)
    done = sweep("run", job, "--out", out, "--cluster", "local", "--workers", "2", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert n_done(out) == 64


def test_a_job_at_its_time_limit_says_that_there_is_more_to_do(
    slurm: Slurm, tmp_path: Path
) -> None:
    job, out = write_job(tmp_path, LONGER, BLOCK), tmp_path / "out"
    limits = ("--array", "1", "--time", "1", "--drain", "52", "--no-reduce")
    done = sweep("slurm", job, "--out", out, "--mode", "array", *limits, "--submit")
    slurm.wait(50)
    assert slurm.exit_code(done.stdout.split()[2]) == 75
    assert n_done(out) < 64


def _job_logs(out: Path) -> str:
    return "\n".join(path.read_text() for path in (out / "slurm").glob("chimera-*.log"))
