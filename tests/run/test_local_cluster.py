"""The makers of Dask clusters: nothing given up too early, nothing waited for without end."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any, ClassVar

import dask
import psutil
import pytest
from dask.utils import parse_timedelta

from chimera_hpc.base.memory import usable_memory
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run import choice
from chimera_hpc.run import local_cluster as cluster
from chimera_hpc.run.local_cluster import local_cluster, settings
from chimera_hpc.run.slurm.workers import worker_settings


def test_worker_that_is_slow_to_come_back_is_not_given_up() -> None:
    # Dask's own 15 s are over soon on a busy machine; then it ends the nanny and its new worker.
    assert parse_timedelta(settings()["distributed.deploy.lost-worker-timeout"]) > 24 * 3600


class Stuck:
    """A cluster that does not close."""

    def __init__(self, pid: int, *given: Any, **options: Any) -> None:
        self.nanny = SimpleNamespace(auto_restart=True, process=SimpleNamespace(pid=pid))
        self.workers = {0: self.nanny}
        self.limits: list[float] = []

    def close(self, timeout: float) -> None:
        self.limits.append(timeout)
        raise TimeoutError


def test_cluster_that_does_not_close_is_left_behind_without_workers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as worker:
        stuck = Stuck(worker.pid)
        monkeypatch.setattr("distributed.SpecCluster", lambda **options: stuck)
        monkeypatch.setattr("distributed.Client", FakeClient)
        with local_cluster(1) as client:
            assert isinstance(client, FakeClient)
            assert dask.config.get("distributed.scheduler.work-stealing") is False
        assert worker.wait(timeout=30) == -signal.SIGKILL
    assert stuck.limits == [cluster._CLOSE_SECONDS]
    assert stuck.nanny.auto_restart is False


def test_nothing_listens_beyond_loopback() -> None:
    with local_cluster(1) as client:
        (worker,) = client.run(os.getpid).values()
        tree = [psutil.Process(), *psutil.Process().children(recursive=True)]
        listening = {process.pid: _listening(process) for process in tree}
    # Scheduler and nanny live in this process; each process also has the server of its dashboard.
    assert len(listening[os.getpid()]) >= 3
    assert len(listening[worker]) >= 2
    hosts = {host for found in listening.values() for host in found}
    assert hosts <= {"127.0.0.1", "::1"}


def _listening(process: psutil.Process) -> list[str]:
    found = process.net_connections(kind="inet")
    return [one.laddr.ip for one in found if one.status == psutil.CONN_LISTEN]


def test_workers_load_no_dashboard_and_are_not_profiled() -> None:
    with local_cluster(1) as client:
        (found,) = client.run(_loaded_bokeh_and_profiled).values()
    assert found == (False, False)


def _loaded_bokeh_and_profiled(dask_worker: Any) -> tuple[bool, bool]:
    return "bokeh" in sys.modules, "profile" in dask_worker.periodic_callbacks


def test_processes_are_seldom_asked_how_they_are() -> None:
    # Dask's own 20 ms and 500 ms take time of the cores that integrate.
    with local_cluster(1) as client:
        (worker,) = client.run(_milliseconds_between_looks).values()
        (nanny,) = client.cluster.workers.values()
        assert min(worker["tick"], worker["monitor"]) >= 5000
        assert 500 <= nanny.periodic_callbacks["memory_monitor"].callback_time <= 1000


def _milliseconds_between_looks(dask_worker: Any) -> dict[str, float]:
    return {name: call.callback_time for name, call in dask_worker.periodic_callbacks.items()}


@pytest.mark.parametrize(("patience", "seconds"), [(60.0, 5.0), (12.0, 1.0), (1.0, 0.5)])
def test_workers_say_seldom_that_they_are_there(patience: float, seconds: float) -> None:
    with local_cluster(1, patience=patience) as client:
        (found,) = client.run(_heartbeat_seconds).values()
    assert found == seconds


async def _heartbeat_seconds(dask_worker: Any) -> float:
    await dask_worker.heartbeat()
    return float(dask_worker.periodic_callbacks["heartbeat"].callback_time) / 1000


def test_workers_in_other_jobs_get_the_settings_of_their_kind() -> None:
    theirs = ("distributed.worker.", "distributed.admin.")
    ours = {name: value for name, value in settings().items() if name.startswith(theirs)}
    asked = f"import dask, distributed; print([dask.config.get(name) for name in {list(ours)}])"
    script = "\n".join([*worker_settings(), f"exec {sys.executable} -c {shlex.quote(asked)}"])
    shell = subprocess.run(["sh"], input=script, capture_output=True, text=True, check=True)
    assert shell.stdout.strip() == str(list(ours.values()))


def test_workers_share_the_memory_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("distributed.SpecCluster", Recorded)
    monkeypatch.setattr("distributed.Client", FakeClient)
    for given, expected in ((None, usable_memory() // 3), ("2GiB", "2GiB")):
        with local_cluster(3, memory_limit=given):
            limits = [one["options"]["memory_limit"] for one in Recorded.workers.values()]
            assert limits == [expected] * 3


class Recorded:
    """A cluster that starts nothing and notes its workers."""

    workers: ClassVar[dict[int, Any]] = {}

    def __init__(self, workers: dict[int, Any], **options: Any) -> None:
        Recorded.workers = workers

    def close(self, timeout: float) -> None:
        pass


@pytest.mark.parametrize(("workers", "n_lines"), [(3, 1), (2, 0), (0, 0)])
def test_more_workers_than_cores_are_warned_of(
    workers: int, n_lines: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choice, "usable_cores", lambda: 2)
    monkeypatch.setattr(choice, "local_cluster", lambda *_, **__: nullcontext("a client"))
    said: list[str] = []
    with choice.ExecutorChoice("local", workers).cluster(tmp_path, 9, said.append, 60.0) as found:
        assert found[0] == "a client"
    assert len(said) == n_lines
    assert all("3 workers share 2 cores" in line and "--workers 2" in line for line in said)


class FakeClient:
    """A client that only takes the plugin."""

    def __init__(self, cluster: Any) -> None:
        self.plugins: list[Any] = []

    def __enter__(self) -> FakeClient:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def register_plugin(self, plugin: Any) -> None:
        self.plugins.append(plugin)


def test_something_is_done_while_the_workers_start() -> None:
    done = Event()
    with local_cluster(1, meanwhile=done.set):
        assert done.wait(timeout=30)


BY_SLURM = {"slurm_options": Slurm()}


@pytest.mark.parametrize(
    ("kind", "asked", "options", "more"),
    [
        ("local", "run.choice.local_cluster", {"workers": 1}, False),
        ("scheduler-file", "run.choice.existing_cluster", {"scheduler_file": Path("s")}, False),
        ("slurm", "run.slurm.workers.slurm_cluster", {"slurm_options": Slurm()}, True),
        (
            "allocation",
            "run.slurm.allocation.allocation_cluster",
            {"slurm_options": Slurm()},
            False,
        ),
    ],
)
def test_each_choice_starts_or_joins_its_own_cluster(
    kind: str,
    asked: str,
    options: dict[str, Any],
    more: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: Any = ("client", SimpleNamespace(coming=lambda: True)) if more else "client"
    monkeypatch.setattr(f"chimera_hpc.{asked}", lambda *given, **options: nullcontext(made))
    chosen = choice.ExecutorChoice(kind, **options)
    with chosen.cluster(Path("store"), 9, print, 60.0) as (client, coming):
        assert (client, coming()) == ("client", more)
