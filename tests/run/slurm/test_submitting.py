"""Submissions that SLURM refuses, lets wait, or answers late; strangers at the scheduler."""

from __future__ import annotations

import os
import pickle
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from slurm_real import Slurm
from slurm_sweeps import command, sweep, sweep_here, write_job

from chimera_hpc.base.errors import BadInput
from chimera_hpc.run.slurm import queue, tls
from chimera_hpc.run.slurm.script import SCRIPTS, job_name, templates

pytestmark = pytest.mark.slurm

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("how", [("slurm", "--submit"), ("run", "--cluster", "slurm")])
def test_a_refused_job_is_told_in_one_line(
    how: tuple[str, ...], slurm: Slurm, tmp_path: Path
) -> None:
    job = write_job(tmp_path)
    began = time.monotonic()
    done = sweep(how[0], job, "--out", tmp_path / "out", *how[1:], "--mem", "90000M")
    seconds = time.monotonic() - began
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: SLURM refuses the job: ")
    assert "node configuration is not available" in line
    # Neither a plan nor compiled kernels come before the answer.
    assert not (tmp_path / "out").exists()
    assert seconds < 5 * max(1.0, _load())


def _load() -> float:
    """Return how many processes want each core."""
    return os.getloadavg()[0] / (os.cpu_count() or 1)


def test_a_network_that_is_not_there_is_told_before_anything_begins(
    slurm: Slurm, tmp_path: Path
) -> None:
    words = ("--cluster", "slurm", "--interface", "nowhere0")
    done = sweep("run", write_job(tmp_path), "--out", tmp_path / "out", *words)
    assert done.returncode == 2
    assert re.fullmatch(r"error: interface nowhere0: not here; allowed: .*lo.*\n", done.stderr)
    assert not (tmp_path / "out").exists()


def test_a_machine_without_slurm_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    for how in (("slurm", "--submit"), ("run", "--cluster", "slurm")):
        done = sweep_here(how[0], write_job(tmp_path), "--out", tmp_path / "out", *how[1:])
        assert done.returncode == 2
        assert done.stderr == "error: sbatch: not found: this is no machine of a SLURM cluster\n"


@pytest.mark.slow
def test_the_reason_of_a_waiting_job_is_told(slurm: Slurm, tmp_path: Path) -> None:
    blocker = slurm.sh(
        *("sbatch", "--parsable", "--exclusive", "-N2", "-o", "/dev/null", "--wrap", "sleep 60")
    )
    job = write_job(tmp_path)
    words = command("run", job, "--out", tmp_path / "out", "--cluster", "slurm", "--no-figures")
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    log = tmp_path / "out" / "run.log"
    try:
        slurm.until(lambda: "asked for" in _text(log), 120, "nothing submitted")
        slurm.until(lambda: "jobs that wait" in _text(log), 10, "no reason told")
        assert "for Resources" in _text(log) or "for Priority" in _text(log)
        slurm.sh("scancel", blocker)
        said, _ = process.communicate(timeout=240)
        assert process.returncode == 0, said
    finally:
        process.kill()
        process.communicate()


def test_what_a_submitted_job_waits_for_is_told(slurm: Slurm, tmp_path: Path) -> None:
    words = ("slurm", write_job(tmp_path), "--out", tmp_path / "out", "--submit")
    done = sweep_here(*words, "--partition", "closed")
    assert done.returncode == 0, done.stderr
    number = done.stdout.split()[2]
    assert done.stdout.splitlines()[-1] == f"job {number} waits: PartitionDown"


def test_elements_run_as_many_at_once_as_was_wished(slurm: Slurm, tmp_path: Path) -> None:
    words = ("slurm", write_job(tmp_path), "--out", tmp_path / "out", "--submit")
    done = sweep_here(*words, "--set", "slurm.extra=['--hold']", "--at-once", "3")
    number = done.stdout.split()[2]
    assert slurm.told(number, "ArrayTaskThrottle") == "3"


def test_a_controller_that_fails_for_a_while_is_asked_again(
    slurm: Slurm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = shutil.which("sbatch")
    fake = tmp_path / "bin" / "sbatch"
    fake.parent.mkdir()
    fake.write_text(
        f"#!/bin/bash\necho x >> {tmp_path}/calls\n"
        f'if [ "$(wc -l < {tmp_path}/calls)" -lt 3 ]; then\n'
        'echo "sbatch: error: Batch job submission failed: Socket timed out on send/recv" >&2\n'
        f'exit 1; fi\nexec {real} "$@"\n'
    )
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{fake.parent}:/usr/bin:/bin")
    script = tmp_path / "job.sh"
    script.write_text("#!/bin/bash\n#SBATCH -o /dev/null --mem=50M\ntrue\n")
    assert queue.submit(script, name="chimera-test").isdecimal()
    assert len((tmp_path / "calls").read_text().split()) == 3


def test_a_refusal_is_not_tried_again(slurm: Slurm) -> None:
    began = time.monotonic()
    with pytest.raises(BadInput, match=r"SLURM refuses the job: .*partition"):
        queue.check("#!/bin/bash\n#SBATCH -p nowhere\ntrue\n")
    assert time.monotonic() - began < 2


def test_arrays_are_cut_to_what_slurm_allows(slurm: Slurm, tmp_path: Path) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    done = sweep_here("slurm", job, "--out", out, "--mode", "array", "--array", "500", "--submit")
    assert done.returncode == 0, done.stderr
    assert "9 elements in place of 500" in done.stdout
    assert len(slurm.queue()) == 10


@pytest.mark.slow
def test_cancel_ends_the_jobs_of_its_own_store_only(slurm: Slurm, tmp_path: Path) -> None:
    job = write_job(tmp_path)
    hold = ("--set", "slurm.extra=['--hold']")
    for name in ("one", "two"):
        done = sweep_here("slurm", job, "--out", tmp_path / name, "--array", "2", *hold, "--submit")
        assert done.returncode == 0, done.stderr
    done = sweep_here("cancel", tmp_path / "one")
    assert done.stdout.count("cancelled job") == 3
    left = [name for _, _, name in slurm.queue()]
    two = tmp_path / "two" / "store.zarr"
    assert sorted(left) == sorted(job_name(two, what) for what in ("array", "array", "reduce"))
    assert "no SLURM job works on" in sweep_here("cancel", tmp_path / "one").stdout


def test_a_sweep_that_is_in_the_queue_is_not_submitted_twice(slurm: Slurm, tmp_path: Path) -> None:
    words = ("slurm", write_job(tmp_path), "--out", tmp_path / "out", "--submit")
    assert sweep_here(*words, "--set", "slurm.extra=['--hold']").returncode == 0
    done = sweep_here(*words)
    assert done.returncode == 2
    assert re.search(r"job \d+\S* does this already; the command cancel ends it", done.stderr)


KNOCK = """
import pickle, sys
from distributed import Client

try:
    Client(sys.argv[1], security=pickle.load(sys.stdin.buffer), timeout=2)
except (OSError, TypeError, ValueError) as error:
    kinds = [kind for kind in (OSError, TypeError, ValueError) if isinstance(error, kind)]
    print(kinds[0].__name__, flush=True)
else:
    print("let in", flush=True)
# A client that was refused may hang in its own clean-up.
import os
os._exit(0)
"""


def knock(address: str, security: object) -> str:
    """Try to reach a scheduler from a process of its own; say what came of it."""
    done = subprocess.run(
        [sys.executable, "-c", KNOCK, address],
        input=pickle.dumps(security),
        capture_output=True,
        timeout=120,
        check=False,
    )
    return done.stdout.decode().strip()


def test_a_client_without_the_certificate_is_refused(tmp_path: Path, monkeypatch) -> None:
    from distributed import LocalCluster
    from distributed.security import Security

    monkeypatch.setenv(tls.PRIVATE, str(tmp_path / "private"))
    with (
        tls.fresh_certificate("mine", tmp_path) as mine,
        tls.fresh_certificate("other", tmp_path) as other,
        LocalCluster(
            n_workers=0,
            protocol="tls://",
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            security=mine.security(),
        ) as cluster,
    ):
        assert mine.folder.stat().st_mode & 0o777 == 0o700
        assert mine.key.stat().st_mode & 0o777 == 0o600
        address = cluster.scheduler_address
        trusting = Security(tls_ca_file=str(mine.cert), require_encryption=True)
        plain = address.replace("tls://", "tcp://")
        assert knock(address, mine.security()) == "let in"
        for where, stranger in ((plain, None), (address, trusting), (address, other.security())):
            assert knock(where, stranger) in {"OSError", "TypeError", "ValueError"}
    assert not mine.folder.exists()


def test_the_handler_of_ctrl_c_outlives_the_import_of_dask_jobqueue() -> None:
    import signal

    from chimera_hpc.run.slurm.workers import _classes

    before = signal.getsignal(signal.SIGINT)
    _classes()
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("name", list(SCRIPTS))
def test_templates_are_what_the_generator_gives(name: str) -> None:
    assert (ROOT / "jobs" / "slurm" / f"{name}.sbatch").read_text() == templates()[name]


@pytest.mark.parametrize("name", list(SCRIPTS))
def test_slurm_takes_the_templates(name: str, slurm: Slurm) -> None:
    queue.check(templates()[name], *(["--array=0-3"] if name == "array" else []))


def _text(path: Path) -> str:
    return path.read_text() if path.exists() else ""
