"""The time that a job has left, the prediction of costs, names and scripts: no SLURM needed."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from slurm_sweeps import JOB

from chimera_hpc.errors import BadInput
from chimera_hpc.grid import Sweep
from chimera_hpc.grid.tables import Slurm
from chimera_hpc.slurm import options, walltime
from chimera_hpc.slurm.queue import one_line, seconds_of
from chimera_hpc.slurm.script import SCRIPTS, Target, job_name
from chimera_hpc.slurm.walltime import CostModel
from chimera_hpc.status import Status


def small() -> Sweep:
    return Sweep.from_toml_text(JOB.format(t_end=100.0, block=4))


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
        return {"status": np.full(64, Status.DONE), "elapsed_us": costs(self.sweep)}


def test_only_what_fits_is_begun_but_for_the_first_block() -> None:
    store, rows = _Store(), np.flatnonzero(small().points().columns["P"] == 5)[:4]
    hours = walltime.Hours(time.time() + 2.5)
    assert hours.fits(store, rows)
    assert not hours.fits(store, rows)
    assert walltime.Hours(time.time() + 4, begun=True).fits(store, rows)


def test_nothing_is_begun_when_the_time_is_over() -> None:
    hours = walltime.Hours(time.time() - 1)
    assert not hours.fits(_Store(), np.arange(1))


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("4:59", 299), ("1:00:00", 3600), ("2-00:00:01", 172801), ("UNLIMITED", None), ("0:00", 0)],
)
def test_times_as_slurm_prints_them(text: str, seconds: float | None) -> None:
    assert seconds_of(text) == seconds


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
    wishes = options.wishes(table, {"time": "3", "mem": None})
    assert (wishes.account, wishes.partition, wishes.time) == ("mine", "jobs", "3")


def test_wishes_that_are_none_are_refused_with_their_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(BadInput, match=r"slurm\.mem: .*: '1 potato'"):
        options.wishes(Slurm.model_validate({}), {"mem": "1 potato"})
    own = tmp_path / "chimera_hpc" / "config.toml"
    own.parent.mkdir()
    own.write_text('[slurm]\npartitoin = "x"\n')
    with pytest.raises(BadInput, match=r"partitoin: unknown key.*partition"):
        options.wishes(Slurm.model_validate({}), {})


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
