"""The serial executor is the specification: every other way of running leaves the same bytes."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.exits import Exit
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

JOB = SMALL | {
    "name": "bits",
    "grid.P": [2, 3],
    "grid.Q": "0:P",
    "grid.seeds": 10,
    "fixed.n_nodes": 9,
    "features.groups": 3,
    **dict.fromkeys(("integrator.t_step", "features.n_peaks", "features.n_overlap", "run.block")),
}


def write_job(folder, t_end=60.0, start=40.0):
    job = folder / "bits.toml"
    job.write_text(job_text(JOB, {"integrator.t_end": t_end, "features.start": start}))
    return job


def contents(folder):
    store = Store.open(folder / "store.zarr")
    series = np.array([store.series(i) for i in range(store.n_points)])
    return store.features(), store.scalars(), store.ledger(), series


def assert_same(folder, reference):
    features, scalars, ledger, series = contents(folder)
    expected_features, expected_scalars, expected_ledger, expected_series = reference
    assert features.tobytes() == expected_features.tobytes()
    assert series.tobytes() == expected_series.tobytes()
    for name, column in scalars.items():
        assert column.tobytes() == expected_scalars[name].tobytes(), name
    for name in ("status", "steps", "n_windows", "digest"):
        assert (ledger[name] == expected_ledger[name]).all(), name


def run(job, out, *options):
    return main(["run", str(job), "--out", str(out), "--no-figures", *options])


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    folder = tmp_path_factory.mktemp("serial")
    assert run(write_job(folder), folder / "out", "--cluster", "serial", "--block", "7") == 0
    return contents(folder / "out")


def test_serial_run_has_runs_of_more_than_one_kind(serial):
    status = serial[2]["status"]
    assert len(status) == 70
    assert set(status.tolist()) <= {1, 2, 3}
    assert len(set(serial[2]["digest"].tolist())) > 60


@pytest.mark.slow
@pytest.mark.parametrize("block", [1, 64])
def test_block_size_changes_no_bit(block, serial, tmp_path):
    options = ("--cluster", "serial", "--block", str(block))
    assert run(write_job(tmp_path), tmp_path / "out", *options) == 0
    assert_same(tmp_path / "out", serial)


@pytest.mark.parametrize(("workers", "block"), [(1, 7), (2, 7), (2, 64)])
def test_dask_leaves_the_bytes_of_the_serial_run(workers, block, serial, tmp_path):
    options = ("--workers", str(workers), "--block", str(block))
    assert run(write_job(tmp_path), tmp_path / "out", *options) == 0
    assert_same(tmp_path / "out", serial)


def start(job, out):
    command = [sys.executable, "-m", "chimera_hpc.sweep", "run", job, "--out", out]
    command += ["--workers", "2", "--block", "5", "--no-figures"]
    return subprocess.Popen(
        list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def wait_for_blocks(out, count, process):
    ledger = out / "store.zarr" / "ledger"
    end = time.monotonic() + 120
    while time.monotonic() < end and process.poll() is None:
        if ledger.is_dir() and len([n for n in os.listdir(ledger) if n.startswith("c.")]) >= count:
            return
        time.sleep(0.02)
    pytest.fail("the run did not get under way")


@pytest.mark.slow
def test_killed_driver_and_workers_lose_only_the_blocks_in_flight(tmp_path):
    job = write_job(tmp_path, t_end=800.0, start=780.0)
    assert run(job, tmp_path / "whole", "--cluster", "serial", "--block", "5") == 0
    out = tmp_path / "out"
    driver = start(job, out)
    wait_for_blocks(out, 3, driver)
    family = [psutil.Process(driver.pid), *psutil.Process(driver.pid).children(recursive=True)]
    for process in family:
        process.send_signal(signal.SIGKILL)
    driver.wait()
    psutil.wait_procs(family, timeout=10)
    before = Store.open(out / "store.zarr").ledger()
    done = before["status"] != 255
    assert 15 <= done.sum() < 70
    assert run(job, out, "--workers", "2", "--block", "5") == 0
    assert_same(out, contents(tmp_path / "whole"))
    after = Store.open(out / "store.zarr").ledger()
    for name in ("attempts", "run", "elapsed_us"):
        assert (after[name][done] == before[name][done]).all(), name
    # Two workers had one block of five points each in hand.
    assert (after["attempts"] > 1).sum() <= 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, Exit.INTERRUPTED), (signal.SIGTERM, Exit.MORE_TO_DO)]
)
def test_signal_stops_in_good_order_and_the_same_command_goes_on(number, status, tmp_path):
    job = write_job(tmp_path, t_end=800.0, start=780.0)
    out = tmp_path / "out"
    driver = start(job, out)
    wait_for_blocks(out, 2, driver)
    driver.send_signal(number)
    assert driver.wait(60) == status
    left = Store.open(out / "store.zarr").ledger()["status"] == 255
    assert left.any()
    assert run(job, out, "--cluster", "serial") == 0
    assert not (Store.open(out / "store.zarr").ledger()["status"] == 255).any()


def test_second_run_computes_nothing(serial, tmp_path, capsys):
    job = write_job(tmp_path)
    assert run(job, tmp_path / "out", "--cluster", "serial") == 0
    first = Store.open(tmp_path / "out" / "store.zarr").ledger()
    assert run(job, tmp_path / "out", "--cluster", "serial") == 0
    second = Store.open(tmp_path / "out" / "store.zarr").ledger()
    for name, column in first.items():
        assert (column == second[name]).all(), name
