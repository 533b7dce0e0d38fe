"""``run`` and ``retry``: failures, damage, provenance, stopping, and what is said of them."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.cli.arguments import bytes_of
from chimera_hpc.cli.estimate import (
    LANES_PER_SAMPLE,
    MOST_SIDE_BY_SIDE,
    memory_warnings,
    worker_bytes,
)
from chimera_hpc.integrate import lanes
from chimera_hpc.job import Points, Sweep
from chimera_hpc.run import work
from chimera_hpc.run.block import run_block
from chimera_hpc.run.choice import ExecutorChoice
from chimera_hpc.run.driver import Driver
from chimera_hpc.run.executors import ClusterLost
from chimera_hpc.store.block_result import BlockResult, failed_block
from chimera_hpc.store.ledger import read_ledger
from chimera_hpc.store.store import Store

Run = Callable[..., tuple[int, str, str]]
SERIAL = ("--cluster", "serial", "--no-figures")


def run_words(job: Path, folder: Path, *options: str) -> list[object]:
    return ["run", job, "--out", folder, *SERIAL, *options]


def failing(
    monkeypatch: pytest.MonkeyPatch, status: Status, which: Callable[[dict[str, Any]], bool]
) -> list[int]:
    """Have some points fail; return the list of the sizes of calls."""
    sizes: list[int] = []

    def run(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
        sizes.append(len(points))
        result = run_block(sweep, points, should_stop=should_stop)
        lost = failed_block(sweep, points, status)
        for i in range(len(points)):
            if which(points.row(i)):
                result.status[i] = status
                result.features[i], result.scalars[i] = lost.features[i], lost.scalars[i]
        return result

    monkeypatch.setattr(work, "run_block", run)
    return sizes


def attempts(folder: Path) -> dict[int, int]:
    """Return status -> attempts of its points."""
    ledger = read_ledger(folder / "store.zarr")
    return dict(zip(ledger["status"].tolist(), ledger["attempts"].tolist(), strict=True))


def store_of(folder: Path) -> Store:
    return Store.open(folder / "store.zarr")


def test_time_outs_are_tried_again_within_the_attempts_and_then_remain(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = failing(monkeypatch, Status.TIME_OUT, lambda row: row["seed"] == 1 and row["P"] == 3)
    words = run_words(job, tmp_path / "out", "--set", "run.attempts=3")
    code, out, _ = sweep(*words)
    assert code == 1
    assert "1 points failed:\n  P=3 Q=3 seed=1: time-out" in out
    assert sizes == [4, 4, 4, 3, 1, 1]
    assert attempts(tmp_path / "out")[Status.TIME_OUT] == 3
    assert sweep(*words)[0] == 1
    assert sizes == [4, 4, 4, 3, 1, 1]


def test_numerical_failures_are_not_tried_again(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = failing(monkeypatch, Status.NON_FINITE, lambda row: row["seed"] == 1)
    code, out, _ = sweep(*run_words(job, tmp_path / "out"))
    assert code == 1
    assert "3 points failed:" in out
    assert sizes == [4, 4, 4, 3]


def test_many_failures_are_listed_in_part_and_where_to_find_the_rest(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing(monkeypatch, Status.NON_FINITE, lambda row: True)
    code, out, _ = sweep(*run_words(job, tmp_path / "out", "--set", "seeds=10"))
    assert code == 1
    assert len(re.findall(r"^  P=\d Q=\d seed=\d: non-finite", out, re.MULTILINE)) == 20
    assert f"and 10 more: status --failures {tmp_path / 'out'}" in out
    code, out, _ = sweep("status", tmp_path / "out", "--failures")
    assert code == 1
    assert len(re.findall(r"^  P=\d Q=\d seed=\d: non-finite", out, re.MULTILINE)) == 30


def test_retry_computes_the_failed_points_once_and_no_others(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    failing(monkeypatch, Status.NON_FINITE, lambda row: row["seed"] == 1)
    sweep(*run_words(job, out))
    sizes = failing(monkeypatch, Status.TIME_OUT, lambda row: row["seed"] == 1 and row["P"] == 2)
    assert sweep("retry", out, *SERIAL)[0] == 1
    assert sizes == [1, 1, 1]
    monkeypatch.setattr(work, "run_block", run_block)
    assert sweep("retry", out, *SERIAL, "--status", "non_finite")[0] == 1
    code, _, err = sweep("retry", out, *SERIAL, "--status", "time_out,non_finite")
    assert code == 0
    assert "1 of 4 blocks to do" in err
    ledger = read_ledger(out / "store.zarr")
    assert ledger["attempts"][1] == 3
    assert ledger["run"].tolist().count(1) == 12


def test_retry_takes_settings_and_limits_of_its_own(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    seen = []

    def run(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
        seen.append((sweep.run.tighten, sweep.integrator.max_steps))
        return failed_block(sweep, points, Status.STEP_BUDGET)

    monkeypatch.setattr(work, "run_block", run)
    sweep(*run_words(job, out, "--block", "15"))
    sweep("retry", out, *SERIAL, "--max-steps", "77", "--set", "run.tighten=0.5")
    assert seen == [(0.1, 10_000_000), (0.5, 77)]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--status", "time-out"], "did you mean time_out?"),
        (["--time-out", "-1"], "--time-out -1.0: must be above 0"),
        (["--max-steps", "0"], "--max-steps 0: must be above 0"),
        (["--set", "integrator.rtol=1e-5"], "integrator.rtol: 1e-05 here, 0.001 in the store"),
    ],
)
def test_retry_refuses_what_it_cannot_use(
    words: list[str], message: str, finished: Path, sweep: Run
) -> None:
    code, _, err = sweep("retry", finished, *SERIAL, *words)
    assert code == 2
    assert message in err
    assert len(err.splitlines()) == 1


def test_damage_found_by_the_reduction_is_computed_again(
    job: Path, finished: Path, sweep: Run
) -> None:
    before = store_of(finished).ledger()
    chunk = finished / "store.zarr" / "scalars" / "c.1.0"
    data = bytearray(chunk.read_bytes())
    data[40] ^= 4
    chunk.write_bytes(data)
    code, out, _ = sweep(*run_words(job, finished))
    assert code == 0
    assert "damaged, to be computed again: block 1, scalars: wrong checksum" in out
    after = store_of(finished).ledger()
    assert (after["digest"] == before["digest"]).all()
    assert after["run"].tolist() == [1] * 4 + [2] * 4 + [1] * 7


def test_reduce_of_a_damaged_store_is_one_line(finished: Path, sweep: Run) -> None:
    (finished / "store.zarr" / "scalars" / "c.1.0").unlink()
    code, _, err = sweep("reduce", finished)
    assert code == 2
    assert err.count("\n") == 1
    assert "block 1, scalars: missing" in err


def change_provenance(folder: Path, **changes: Any) -> None:
    record = folder / "store.zarr" / "runs" / "1.json"
    record.write_text(json.dumps({**json.loads(record.read_bytes()), **changes}))


def test_other_code_is_warned_of_and_its_points_are_marked(
    job: Path, finished: Path, sweep: Run
) -> None:
    change_provenance(finished, source="feedbeef00000000")
    (finished / "store.zarr" / "ledger" / "c.0.0").unlink()
    code, _, err = sweep(*run_words(job, finished))
    assert code == 0
    assert "warning: run 1 had other source: feedbeef00000000 before" in err
    assert store_of(finished).ledger()["run"].tolist() == [2] * 4 + [1] * 11


def test_strict_refuses_other_code_and_leaves_everything(
    job: Path, finished: Path, sweep: Run
) -> None:
    change_provenance(finished, python="2.7.18")
    (finished / "store.zarr" / "ledger" / "c.0.0").unlink()
    code, _, err = sweep(*run_words(job, finished, "--strict"))
    assert code == 2
    assert "--strict: run 1 had other python: 2.7.18 before" in err
    assert sorted(os.listdir(finished / "store.zarr" / "runs")) == ["1.json", "1.work.json"]


def test_strict_has_nothing_against_the_same_code(job: Path, finished: Path, sweep: Run) -> None:
    (finished / "store.zarr" / "ledger" / "c.0.0").unlink()
    assert sweep(*run_words(job, finished, "--strict"))[0] == 0


def test_full_disk_is_one_line_and_more_to_do(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, count = Store.write_block, 0

    def filling(*args: Any, **options: Any) -> Any:
        nonlocal count
        count += 1
        if count > 2:
            raise OSError(errno.ENOSPC, "No space left on device", "u/c.2")
        return write(*args, **options)

    monkeypatch.setattr(Store, "write_block", filling)
    code, out, err = sweep(*run_words(job, tmp_path / "out"))
    assert code == 75
    assert "stopped: No space left on device (u/c.2)" in err
    assert "stopped: 7 of 15 points left; to go on:" in out
    assert count == 3
    monkeypatch.undo()
    assert sweep(*run_words(job, tmp_path / "out"))[0] == 0
    assert set(read_ledger(tmp_path / "out" / "store.zarr")["attempts"].tolist()) == {1}


def test_error_of_a_network_file_system_is_tried_again(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, count = Store.write_block, 0

    def shaky(*args: Any, **options: Any) -> Any:
        nonlocal count
        count += 1
        if count in (1, 2):
            raise OSError(errno.ESTALE, "Stale file handle")
        return write(*args, **options)

    monkeypatch.setattr(Store, "write_block", shaky)
    assert sweep(*run_words(job, tmp_path / "out"))[0] == 0


def test_block_that_cannot_be_done_is_put_aside_and_told_of(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
        if (points.columns["seed"] == 4).any() and (points.columns["P"] == 3).any():
            raise LookupError("no such thing")
        return run_block(sweep, points)

    monkeypatch.setattr(work, "run_block", run)
    code, out, _ = sweep(*run_words(job, tmp_path / "out"))
    assert code == 1
    assert "block 2 could not be done: point P=3 Q=3 seed=4: LookupError: no such thing" in out
    assert read_ledger(tmp_path / "out" / "store.zarr")["status"].tolist().count(255) == 1
    assert "Traceback" in (tmp_path / "out" / "run.log").read_text()


@pytest.fixture
def _hang_up_is_heard() -> Iterator[None]:
    """SIGHUP as in a terminal: `nohup` has it ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("_hang_up_is_heard")
@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 75), (signal.SIGHUP, 75)]
)
def test_signal_stops_in_good_order(
    number: int,
    status: int,
    job: Path,
    tmp_path: Path,
    sweep: Run,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def run(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
        os.kill(os.getpid(), number)
        return run_block(sweep, points, should_stop=should_stop)

    monkeypatch.setattr(work, "run_block", run)
    before = signal.getsignal(number)
    words = run_words(job, tmp_path / "out")
    code, out, _ = sweep(*words)
    assert code == status
    assert "stopped: 15 of 15 points left; to go on:" in out
    assert "-m chimera_hpc.sweep run" in out
    assert signal.getsignal(number) == before
    assert not list((tmp_path / "out" / "store.zarr" / "runs").glob("*.stop"))
    monkeypatch.undo()
    assert sweep(*words)[0] == 0


def test_second_interrupt_breaks_off_at_once(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("not reached")

    monkeypatch.setattr(work, "run_block", run)
    code, out, _ = sweep(*run_words(job, tmp_path / "out"))
    assert code == 130
    assert "broken off; to go on:" in out
    monkeypatch.undo()
    assert sweep(*run_words(job, tmp_path / "out"))[0] == 0


def test_cluster_that_is_lost_is_started_again_and_in_the_end_given_up(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = []

    @contextmanager
    def cluster(
        choice: ExecutorChoice, store: Path, n_blocks: int, say: Any, patience: float, *_: Any
    ) -> Iterator[tuple[None, Any]]:
        started.append(patience)
        yield None, bool

    def lost(*_: Any) -> None:
        raise ClusterLost("the scheduler is gone")

    monkeypatch.setattr(ExecutorChoice, "cluster", cluster)
    monkeypatch.setattr("chimera_hpc.run.executors.run_dask", lost)
    code, out, err = sweep("run", job, "--out", tmp_path / "out", "--no-figures")
    assert code == 75
    assert started == [60.0, 60.0, 60.0]
    assert "the cluster is lost (the scheduler is gone), 3 of 3 times" in err
    assert "15 of 15 points left" in out


def test_driver_that_plans_a_moment_too_late_takes_the_store_that_is_there(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = Store.plan

    def late(path: Path, spec: Sweep) -> Store:
        plan(path, spec)
        return plan(path, spec)

    monkeypatch.setattr(Store, "plan", late)
    assert sweep(*run_words(job, tmp_path / "out"))[0] == 0


def test_absurd_plan_is_refused_unless_it_is_meant(job: Path, tmp_path: Path, sweep: Run) -> None:
    absurd = ("--set", "seeds=1000000", "--block", "1", "--set", "keep.series=none")
    code, out, err = sweep("plan", job, *absurd)
    assert code == 2
    assert "points      3000000" in out
    assert "files are more than 500000" in err
    assert "--yes if that is meant" in err
    assert sweep("plan", job, *absurd, "--yes")[0] == 0
    code, _, err = sweep(*run_words(job, tmp_path / "out", *absurd))
    assert code == 2
    assert "files are more than 500000" in err
    assert not (tmp_path / "out").exists()


def test_plan_that_does_not_fit_on_the_disk_is_refused(
    job: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chimera_hpc.cli.estimate.free_bytes", lambda folder: 1000)
    code, _, err = sweep("plan", job)
    assert code == 2
    assert "may be needed, 1 kB are free" in err


def test_plan_says_what_workers_take_and_how_many_fit(
    job: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("plan", job, "--set", "run.workers=3")
    monkeypatch.setattr("chimera_hpc.cli.estimate.usable_memory", lambda: 10**9)
    code, out, _ = sweep(*words)
    assert code == 0
    assert re.search(r"memory      about (19|2\d)\d MB per worker, \d+ MB for 3\n", out)
    assert "warning" not in out
    monkeypatch.setattr("chimera_hpc.cli.estimate.usable_memory", lambda: 5 * 10**8)
    assert "warning: there are 500 MB of memory here; run with --workers 2" in sweep(*words)[1]


def test_memory_in_which_no_worker_can_run_is_refused(
    job: Path, tmp_path: Path, sweep: Run
) -> None:
    words = ("run", job, "--out", tmp_path / "out", "--no-figures", "--mem")
    code, _, err = sweep(*words, "50M")
    assert code == 2
    assert re.search(r"--mem 50M: a worker of \w+ takes about (19|2\d)\d MB; at least half", err)
    assert not (tmp_path / "out").exists()
    # A worker, not this process, has the limit.
    assert sweep(*words, "50M", "--cluster", "serial")[0] == 0


def test_memory_that_workers_may_exceed_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    small = Sweep.from_toml_text(job_text(SMALL, {"keep.series": "none"}))
    large = Sweep.from_toml_text(job_text(SMALL, {"integrator.t_end": 500_000.0}))
    monkeypatch.setattr("chimera_hpc.cli.estimate.usable_memory", lambda: 10**9)
    for workers, size in ((4, None), (6, "600M")):
        assert memory_warnings(small, 1, 1, workers, size) == []
    (line,) = memory_warnings(small, 1, 1, 6, None)
    assert re.fullmatch("warning: there are 1 GB of memory here; run with --workers [45]", line)
    (line,) = memory_warnings(large, 1, 1, 1, None)
    assert line.endswith("run with a shorter analysis interval or fewer nodes")
    (line,) = memory_warnings(small, 1, 1, 4, "150M")
    assert re.fullmatch(
        r"warning: --mem 150M: a worker takes about \d+ MB; points may not fit", line
    )


def test_run_warns_of_memory_before_it_begins(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(driver: Driver) -> None:
        raise BadInput("enough")

    monkeypatch.setattr(Driver, "work", refuse)
    words = ("run", job, "--out", tmp_path / "out", "--no-figures", "--workers", "2")
    warnings = [sweep(*words, *more)[2] for more in ((), ("--mem", "150M"))]
    assert "warning" not in warnings[0]
    assert "warning: --mem 150M: a worker takes about " in warnings[1]
    monkeypatch.setattr("chimera_hpc.cli.estimate.usable_memory", lambda: 3 * 10**8)
    assert "300 MB of memory here; run with --workers 1" in sweep(*words)[2]


@pytest.mark.parametrize(
    ("size", "bytes_"), [("800", 800 * 2**20), ("3K", 3072), ("2G", 2**31), ("1T", 2**40)]
)
def test_sizes_are_read_as_slurm_reads_them(size: str, bytes_: int) -> None:
    assert bytes_of(size) == bytes_


def test_memory_of_a_worker_counts_samples_and_points() -> None:
    assert (LANES_PER_SAMPLE, MOST_SIDE_BY_SIDE) == (8 * lanes.LANES, lanes.SAMPLE_BYTES)
    small, wide = (
        Sweep.from_toml_text(job_text(SMALL, {"fixed.n_nodes": n, "keep.series": "none"}))
        for n in (50, 50_000)
    )
    samples = 50_000 * wide.n_samples
    assert worker_bytes(small, 10, 1) < 3e8
    more = worker_bytes(wide, 10, 1) - worker_bytes(small, 10, 1)
    assert more == pytest.approx(24 * samples, rel=0.01)
    assert worker_bytes(small, 10**7, 4000) < 3e8
    added = small.model_copy(update={"continue_": object()})
    assert worker_bytes(added, 10**7, 4000) > 1e9


def test_a_ctrl_c_that_another_package_makes_an_error_of_is_a_ctrl_c(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrapped(*_: Any) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            raise RuntimeError("a schema could not be built") from error

    monkeypatch.setattr("chimera_hpc.cli.run.load_job", wrapped)
    code, out, _ = sweep("run", job, "--out", tmp_path / "out", "--cluster", "serial")
    assert code == 130
    assert "broken off; to go on:" in out


def test_a_ctrl_c_inside_of_compiled_text_leaves_the_status_of_any_other(tmp_path: Path) -> None:
    program = (
        "import sys\n"
        "from chimera_hpc.cli import main, run\n"
        "text = 'import signal; signal.raise_signal(signal.SIGINT)'\n"
        "run.load_job = lambda *_: exec(text)\n"
        "sys.argv = ['sweep', 'run', 'quickstart', '--cluster', 'serial']\n"
        "main.run()\n"
    )
    (tmp_path / "interrupted_run.py").write_text(program)
    command = [sys.executable, "-m", "interrupted_run"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True)
    assert done.returncode == 130
