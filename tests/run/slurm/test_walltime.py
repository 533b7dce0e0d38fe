"""The time that a job has left, the prediction of costs, names and scripts: no SLURM needed."""

from __future__ import annotations

import re
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from jobs_for_tests import job_text
from slurm_sweeps import JOB, write_job

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.base.status import Status
from chimera_hpc.cli.resubmitting import go_on
from chimera_hpc.cli.slurm import _fitting
from chimera_hpc.job import Sweep
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run import block as task
from chimera_hpc.run import compiled
from chimera_hpc.run.slurm import options, queue, walltime, warm
from chimera_hpc.run.slurm.queue import limit_seconds, one_line, seconds_of
from chimera_hpc.run.slurm.script import SCRIPTS, Target, job_name
from chimera_hpc.run.slurm.walltime import CostModel
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main


def small() -> Sweep:
    return Sweep.from_toml_text(job_text(JOB))


def costs(sweep: Sweep) -> np.ndarray:
    return np.array(1e5 * sweep.points().columns["P"], dtype=np.int64)


def test_the_cost_of_a_measured_cell_is_its_mean() -> None:
    sweep = small()
    points, elapsed = sweep.points(), costs(sweep)
    model = CostModel(sweep, points, np.full(64, Status.DONE), elapsed)
    rows = np.flatnonzero(points.columns["P"] == 4)
    assert model.seconds(rows) == pytest.approx(0.4 * len(rows), rel=1e-6)


def test_the_cost_of_an_unmeasured_cell_is_near_that_of_its_neighbours() -> None:
    sweep = small()
    points, elapsed = sweep.points(), costs(sweep)
    status = np.where(points.columns["P"] == 4, Status.NEVER, Status.DONE)
    model = CostModel(sweep, points, status, elapsed)
    rows = np.flatnonzero(points.columns["P"] == 4)
    assert model.seconds(rows) / len(rows) == pytest.approx(0.4, rel=0.1)


def test_without_measurements_a_rule_predicts() -> None:
    sweep = small()
    model = CostModel(sweep, sweep.points(), np.full(64, Status.NEVER), np.zeros(64, np.int64))
    assert model.seconds(np.arange(4)) == pytest.approx(4 * model.seconds(np.arange(1)))


class _Store:
    def __init__(self) -> None:
        self.path, self.sweep = Path("store"), small()
        self.points = self.sweep.points()

    def ledger(self) -> dict[str, np.ndarray]:
        n = len(self.points)
        return {"status": np.full(n, Status.DONE), "elapsed_us": costs(self.sweep)[:n]}


def test_only_what_fits_is_begun_but_for_the_first_block() -> None:
    store, rows = _Store(), np.flatnonzero(small().points().columns["P"] == 5)[:4]
    hours = walltime.Hours(time.time() + 2.5)
    assert hours.fits(store, rows)
    assert not hours.fits(store, rows)
    assert walltime.Hours(time.time() + 4, begun=True).fits(store, rows)


def test_points_that_were_added_meanwhile_are_known() -> None:
    store, hours = _Store(), walltime.Hours(time.time() + 60, begun=True)
    store.points = store.points[:32]
    assert hours.fits(store, np.arange(4))
    store.points = store.sweep.points()
    assert hours.fits(store, np.arange(60, 64))


def test_nothing_is_begun_when_the_time_is_over() -> None:
    hours = walltime.Hours(time.time() - 1)
    assert not hours.fits(_Store(), np.arange(1))


@pytest.mark.parametrize(("left", "spared"), [(100.0, 10.0), (86400.0, 60.0)])
def test_a_tenth_of_a_short_job_and_a_minute_of_a_long_one_are_spared(
    left: float, spared: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    end = int(time.time() + left)
    monkeypatch.setenv("SLURM_JOB_ID", "1")
    monkeypatch.setenv("SLURM_JOB_END_TIME", str(end))
    monkeypatch.delenv(walltime.DRAIN, raising=False)
    hours = walltime.this_job.__wrapped__()
    assert hours is not None
    assert end - hours.leave_by == pytest.approx(spared, abs=1.0)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("4:59", 299), ("1:00:00", 3600), ("2-00:00:01", 172801), ("UNLIMITED", None), ("0:00", 0)],
)
def test_times_as_slurm_prints_them(text: str, seconds: float | None) -> None:
    assert seconds_of(text) == seconds


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("30", 1800), ("1:30", 90), ("2:00:00", 7200), ("1-12", 129600), ("1-0:30", 88200)],
)
def test_time_limits_as_slurm_takes_them(text: str, seconds: float) -> None:
    assert limit_seconds(text) == seconds


@pytest.mark.parametrize("option", [("--drain", "60"), ("--drain", "-1"), ("--resubmit", "-1")])
def test_times_that_leave_a_job_nothing_are_refused(
    option: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["slurm", str(write_job(tmp_path)), "--time", "1", *option]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"error: {option[0]} {option[1]}: allowed is 0 ")


def test_complaints_become_one_line() -> None:
    text = "sbatch: error: Too much\nallocation failure: Too much\n"
    assert "\n" not in one_line(text)
    assert one_line(text).startswith("Too much")


def test_jobs_of_other_stores_have_other_names(tmp_path: Path) -> None:
    one, two = (job_name(tmp_path / n / "store.zarr") for n in ("one", "two"))
    assert one != two
    assert job_name(tmp_path / "one" / "store.zarr", "array").startswith(one)


def test_the_command_line_wins_over_the_job_and_the_job_over_the_users_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    own = tmp_path / "chimera_hpc" / "config.toml"
    own.parent.mkdir()
    own.write_text('[slurm]\naccount = "mine"\npartition = "mine"\ntime = "1"\n')
    table = Slurm.model_validate({"partition": "jobs", "time": "2"})
    slurm_options = options.slurm_options(table, {"time": "3", "mem": None})
    assert (slurm_options.account, slurm_options.partition, slurm_options.time) == (
        "mine",
        "jobs",
        "3",
    )


def test_wishes_that_are_none_are_refused_with_their_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(BadInput, match=r"slurm: mem = '1 potato': "):
        options.slurm_options(Slurm.model_validate({}), {"mem": "1 potato"})
    own = tmp_path / "chimera_hpc" / "config.toml"
    own.parent.mkdir()
    for text, told in (
        ('[slurm]\npartitoin = "x"', "slurm: partitoin: unknown key; did you mean partition?"),
        ('partition = "x"', "partition: unknown key; it belongs in [slurm]"),
        ('[slurrm]\npartition = "x"', "slurrm: unknown key; did you mean slurm?"),
    ):
        own.write_text(text)
        with pytest.raises(BadInput, match=re.escape(f"{own}: {told}")):
            options.slurm_options(Slurm.model_validate({}), {})


def test_an_unknown_key_of_the_jobs_table_is_refused_with_the_nearest_one() -> None:
    text = job_text(JOB).replace("interface =", "interfaec =")
    with pytest.raises(BadInput, match=r"slurm.interfaec: unknown key; did you mean interface\?"):
        Sweep.from_toml_text(text)


def test_the_kernels_are_compiled_once_for_a_job_file_a_folder_and_its_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, "cache_folder", lambda: str(tmp_path / "kernels"))
    file = tmp_path / "kernels" / "there" / "kernel-1.nbc"
    file.parent.mkdir(parents=True)
    found = []

    def compile_(sweep: Sweep, points: object) -> None:
        found.append(sweep.digest)
        file.touch()

    monkeypatch.setattr(task, "warm_up", compile_)
    monkeypatch.setattr(compiled, "usable_cores", lambda: 1)
    job = write_job(tmp_path)
    store = Store.plan(tmp_path / "out" / "store.zarr", small())
    for path in (job, job, tmp_path / "out", store.path):
        warm.main(path)
    assert found == [small().digest]
    file.unlink()
    warm.main(store.path)
    assert len(found) == 2


def test_a_worker_does_not_get_the_kernels_of_its_drivers_node(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("SLURMD_NODENAME", "n1")
    monkeypatch.setenv("SLURM_JOB_ID", "7")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/shared/chimera_hpc/numba-n1")
    assert not {"NUMBA_CACHE_DIR", "SLURM_JOB_ID"} & set(queue.environment())
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/scratch/kernels")
    assert queue.environment()["NUMBA_CACHE_DIR"] == "/scratch/kernels"


def test_a_script_for_a_sweep_that_is_not_planned_says_all_that_plans_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job, out = write_job(tmp_path), tmp_path / "out"
    assert main(["slurm", str(job), "--out", str(out), "--set", "seeds=2", "--block", "8"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    sets = "--set seeds=2 --set run.block=8"
    assert last.endswith(f"sweep shard {job} --out {out} {sets} --of 4")


def test_arrays_of_all_jobs_are_refused() -> None:
    with pytest.raises(BadInput, match="--array is said by the keys array and at_once"):
        options.slurm_options(Slurm.model_validate({"extra": ["--array=0-63%8"]}), {})


@pytest.mark.parametrize("mode", list(SCRIPTS))
def test_a_script_says_what_was_wished(mode: str, tmp_path: Path) -> None:
    given = {"partition": "gpu", "account": "me", "time": "7", "setup": ["module load x"]}
    target = Target(tmp_path / "a b.toml", tmp_path, "name", logs=tmp_path)
    text = SCRIPTS[mode](target, Slurm.model_validate(given | {"extra": ["--nice=5"]}))
    lines = text.splitlines()
    assert lines[0] == "#!/bin/bash"
    for option in ("--partition=gpu", "--account=me", "--time=7", "--nice=5", "--job-name=name"):
        assert f"#SBATCH {option}" in lines
    assert "module load x" in lines
    assert lines[-1].startswith("exec ")
    assert "OMP_NUM_THREADS=1" in text


@pytest.mark.parametrize(
    ("wanted", "allowed", "made", "said"),
    [
        (9, None, 9, ""),
        (10, None, 9, "9 elements in place of 10: there are 9 blocks\n"),
        (10, 4, 4, "4 elements in place of 10: SLURM allows no more\n"),
    ],
)
def test_an_array_has_as_many_elements_as_there_are_blocks_and_slurm_allows(
    wanted: int,
    allowed: int | None,
    made: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(queue, "most_array_elements", lambda: allowed)
    assert _fitting(Slurm(array=wanted), 9).array == made
    assert capsys.readouterr().out == said


@pytest.mark.parametrize(
    ("status", "ended_by", "job", "restarts", "times", "back"),
    [
        (Exit.MORE_TO_DO, walltime.NEAR, "7", "1", 2, True),
        (Exit.MORE_TO_DO, walltime.NEAR, "7", "2", 2, False),
        (Exit.MORE_TO_DO, walltime.NEAR, "", "0", 2, False),
        (Exit.MORE_TO_DO, "SIGTERM", "7", "0", 2, False),
        (Exit.COMPLETE, walltime.NEAR, "7", "0", 2, False),
    ],
)
def test_a_job_goes_back_into_the_queue_when_its_time_is_over(
    status: int,
    ended_by: str,
    job: str,
    restarts: str,
    times: int,
    back: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    requeued: list[str] = []
    monkeypatch.setattr(queue, "requeue", requeued.append)
    monkeypatch.setenv("SLURM_JOB_ID", job)
    monkeypatch.setenv("SLURM_RESTART_COUNT", restarts)
    driver: Any = SimpleNamespace(ended_by=ended_by)
    assert go_on(status, driver, times) == status
    assert requeued == ([job] if back else [])
