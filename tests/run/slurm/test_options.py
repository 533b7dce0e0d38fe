"""What SLURM's commands and Dask's parts are told; no SLURM is needed."""

from __future__ import annotations

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.slurm import allocation, queue, tls, workers

LOOPBACK = "127.0.0.1"


class Asked(Exception):
    """Ends what would start a cluster, with the options that it was given."""

    def __init__(self, *given: Any, **options: Any) -> None:
        self.options = options


def raise_asked(*given: Any, **options: Any) -> None:
    raise Asked(**options)


def assert_dashboard_on_loopback(words: list[str]) -> None:
    """Assert on a worker's command line: Dask takes the last of repeated options."""
    places = [i for i, word in enumerate(words) if word == "--dashboard-address"]
    assert places
    assert words[places[-1] + 1].rpartition(":")[0] == LOOPBACK


def test_a_squeue_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hanging = tmp_path / "squeue"
    hanging.write_text("#!/bin/sh\nexec sleep 5\n")
    hanging.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.setattr(queue, "_COMMAND_SECONDS", 0.1)
    monkeypatch.setattr(queue, "_FIRST_PAUSE", 0.01)
    with pytest.raises(queue.SlurmFailed, match="squeue: socket timed out: no answer within"):
        queue.jobs()


def test_dashboards_of_worker_jobs_are_told_loopback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "_classes", lambda: (raise_asked, object))
    with pytest.raises(Asked) as caught:
        workers._cluster(Slurm(), "x", tmp_path / "store.zarr", tls.Certificate(tmp_path))
    options = caught.value.options
    assert options["scheduler_options"]["dashboard_address"].rpartition(":")[0] == LOOPBACK
    assert_dashboard_on_loopback(options["worker_extra_args"])


def test_dashboard_of_an_allocation_is_told_loopback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLURM_JOB_ID", "1")
    monkeypatch.setenv(tls.PRIVATE, str(tmp_path / "private"))
    monkeypatch.setattr("distributed.LocalCluster", raise_asked)
    cluster = allocation.allocation_cluster(Slurm(), tmp_path / "store.zarr", print)
    with pytest.raises(Asked) as caught, cluster:
        pass
    assert caught.value.options["dashboard_address"].rpartition(":")[0] == LOOPBACK


def test_dashboards_of_an_allocations_workers_are_told_loopback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[list[str]] = []

    def popen(words: list[str], **streams: Any) -> SimpleNamespace:
        started.append(words)
        return SimpleNamespace(wait=lambda seconds: 0)

    fake = SimpleNamespace(
        run=lambda words, **options: None,
        Popen=popen,
        DEVNULL=subprocess.DEVNULL,
        TimeoutExpired=subprocess.TimeoutExpired,
    )
    monkeypatch.setattr(allocation, "subprocess", fake)
    with allocation._workers(tmp_path / "store.zarr", ["tls://x"], Slurm(), tmp_path / "log"):
        pass
    (words,) = started
    assert_dashboard_on_loopback(words)
