"""The fork server: what workers get from it, which signals it ignores, when it ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.cli import jobs
from chimera_hpc.cli.main import main
from chimera_hpc.run import fork_server

JOB = job_text(SMALL, {"grid.seeds": 20, "integrator.t_end": 4000.0, "features.start": 3900.0})
LOOK = """
import json, multiprocessing, os, signal, sys
from pathlib import Path

def look():
    from numba.core.registry import cpu_target
    server = Path(f"/proc/{os.getppid()}")
    return {
        "server": "def look" not in (server / "cmdline").read_text(),
        "threads of the server": len(list((server / "task").iterdir())),
        # Dask marks its children, for the sake of their titles.
        "environment": {k: v for k, v in os.environ.items() if k != "__DASK_PARENT_PID"},
        "ignored": [n for n in signal.valid_signals() if signal.getsignal(n) == signal.SIG_IGN],
        "blocked": sorted(signal.pthread_sigmask(signal.SIG_BLOCK, [])),
        "numba knows": len(cpu_target.target_context._registries),
        "loaded": "chimera_hpc.run.work" in sys.modules,
    }

if sys.argv[1] == "spawn":
    multiprocessing.get_all_start_methods = lambda: ["spawn"]
method = multiprocessing.get_start_method()
before = dict(os.environ), signal.pthread_sigmask(signal.SIG_BLOCK, [])
from chimera_hpc.run.fork_server import start_fork_server
from chimera_hpc.run.local_cluster import local_cluster
assert start_fork_server() == sys.argv[1]
same = (dict(os.environ), signal.pthread_sigmask(signal.SIG_BLOCK, [])) == before
with local_cluster(1) as client:
    (found,) = client.run(look).values()
same &= multiprocessing.get_start_method() == method
print(json.dumps(found | {"driver as before": same, "pandas": "pandas" in sys.modules}))
"""
linux = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks into /proc")


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """A job that takes a while."""
    file = tmp_path / "job.toml"
    file.write_text(JOB)
    return file


def looked_at(how: str) -> dict[str, Any]:
    """Return what a worker sees that was forked or spawned."""
    done = subprocess.run(
        [sys.executable, "-c", LOOK, how], capture_output=True, text=True, check=True, timeout=120
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.slow
@linux
def test_forked_worker_has_all_imports_and_the_environment_of_a_spawned_one() -> None:
    forked, spawned = looked_at("forkserver"), looked_at("spawn")
    assert (forked["server"], spawned["server"]) == (True, False)
    ours = {"PYTHONWARNINGS", "PYTHONSAFEPATH"}
    for name in (forked["environment"].keys() | spawned["environment"].keys()) - ours:
        assert forked["environment"].get(name) == spawned["environment"].get(name), name
    assert fork_server.ONE_THREAD.items() <= forked["environment"].items()
    assert forked["threads of the server"] == 1
    assert forked["loaded"]
    assert forked["numba knows"] > 0
    assert forked["driver as before"]
    assert not forked["pandas"]  # Dask's own option would import it in the driver
    for found in (forked, spawned):
        assert signal.SIGINT in found["ignored"]
        assert found["blocked"] == []


@pytest.mark.slow
@linux
def test_temporary_folder_with_a_long_name_is_no_obstacle(tmp_path: Path) -> None:
    folder = tmp_path / ("x" * 90)
    folder.mkdir()
    code = """import tempfile
from chimera_hpc.run.fork_server import start_fork_server
from multiprocessing.util import get_temp_dir
print(start_fork_server(), get_temp_dir().startswith(tempfile.gettempdir()))"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"TMPDIR": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["forkserver", "False"]


@pytest.mark.slow
def test_commands_that_need_no_workers_start_none(
    job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def started() -> None:
        raise AssertionError("a fork server was started")

    monkeypatch.setattr(jobs, "start_fork_server", started)
    assert main(["plan", str(job)]) == 0
    short = ["--set", "integrator.t_end=60", "--set", "features.start=30", "--no-figures"]
    words = ["run", str(job), "--out", str(tmp_path / "out"), *short]
    assert main([*words, "--cluster", "serial"]) == 0
    assert main(["status", str(tmp_path / "out")]) == 0
    assert main(["retry", str(tmp_path / "out"), "--cluster", "serial", "--no-figures"]) == 0
    with pytest.raises(AssertionError, match="was started"):
        main(words)


def start(job: Path, *options: str) -> subprocess.Popen[str]:
    """Start a run with two workers in a process group of its own."""
    command = [sys.executable, "-m", "chimera_hpc.sweep", "run", str(job), "--workers", "2"]
    return subprocess.Popen(
        [*command, "--out", str(job.parent / "out"), "--no-figures", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def wait_for(condition: Callable[[], Any], seconds: float = 150.0) -> Any:
    until = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < until
        time.sleep(0.005)
    return found


def servers(driver: int) -> list[psutil.Process]:
    children = psutil.Process(driver).children()
    return [child for child in children if "forkserver" in " ".join(child.cmdline())]


@pytest.fixture
def running(job: Path) -> Iterator[subprocess.Popen[str]]:
    """A run that has just started its fork server."""
    with start(job) as driver:
        wait_for(lambda: servers(driver.pid))
        yield driver
        driver.kill()


@pytest.mark.slow
@linux
def test_server_that_still_imports_ends_with_a_killed_driver(
    running: subprocess.Popen[str],
) -> None:
    family = psutil.Process(running.pid).children(recursive=True)
    running.kill()
    assert psutil.wait_procs(family, timeout=30)[1] == []


@pytest.mark.slow
@linux
def test_server_and_workers_end_with_a_killed_driver(running: subprocess.Popen[str]) -> None:
    (server,) = servers(running.pid)
    wait_for(lambda: len(server.children()) == 2)
    family = psutil.Process(running.pid).children(recursive=True)
    assert len(family) >= 3
    running.kill()
    assert psutil.wait_procs(family, timeout=30)[1] == []


@pytest.mark.slow
@linux
def test_server_outlives_what_a_batch_system_sends_to_all_processes(
    running: subprocess.Popen[str],
) -> None:
    (server,) = servers(running.pid)
    workers = wait_for(lambda: len(server.children()) == 2 and server.children())
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1):
        server.send_signal(number)
    time.sleep(0.5)
    assert server.children() == workers
    running.send_signal(signal.SIGTERM)
    output, _ = running.communicate(timeout=120)
    assert running.returncode == 75, output
    assert psutil.wait_procs([server, *workers], timeout=30)[1] == []


@pytest.mark.slow
@linux
@pytest.mark.parametrize("late", [False, True])
def test_ctrl_c_while_it_imports_or_works_says_nothing_else(
    late: bool, running: subprocess.Popen[str]
) -> None:
    if late:
        (server,) = servers(running.pid)
        wait_for(lambda: len(server.children()) == 2)
    family = psutil.Process(running.pid).children(recursive=True)
    os.killpg(running.pid, signal.SIGINT)
    output, _ = running.communicate(timeout=120)
    assert running.returncode == 130
    assert "to go on:" in output
    assert "Traceback" not in output
    assert psutil.wait_procs(family, timeout=30)[1] == []
