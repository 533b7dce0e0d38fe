"""The package without its source tree: a wheel in an environment of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable
from pathlib import Path

import pytest

from chimera_hpc import __version__
from chimera_hpc.job.schema import FILE_NAME, job_schema, schema_text
from chimera_hpc.job.shipped import job_file, jobs_folder

ROOT = Path(__file__).resolve().parents[1]
Run = Callable[..., str]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run a program of an environment that holds the wheel, in an empty folder."""
    place = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(place)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = place.glob("*.whl")
    venv.create(place / "env", with_pip=False, symlinks=True)
    python = place / "env/bin/python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet"]
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], check=True, capture_output=True)
    # What it depends on comes from the environment of the tests; their own copy of the package,
    # which a line in another .pth file leads to, does not: .pth files of such folders aren't read.
    (site,) = place.glob("env/lib/python*/site-packages")
    (site / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    folder = place / "work"
    folder.mkdir()
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}

    def run(program: str, *words: str, status: int = 0) -> str:
        line = [str(place / "env/bin" / program), *words]
        done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout + done.stderr

    return run


@pytest.mark.slow
def test_the_wheel_plans_runs_and_draws_without_the_source_tree(installed):
    where = installed("python", "-c", "import chimera_hpc; print(chimera_hpc.__file__)").strip()
    assert not Path(where).is_relative_to(ROOT)
    assert installed("chimera-hpc", "--version") == f"chimera_hpc {__version__}\n"
    assert "460 in 23 cells" in installed("chimera-hpc", "plan", "quickstart")
    assert "6380 in 319 cells" in installed("chimera-hpc", "plan", "paper/plane")
    assert json.loads(installed("chimera-hpc", "schema")) == job_schema()
    tiny = ["P=[2,3]", "seeds=2", "n_nodes=12", "integrator.t_end=60", "features.start=30"]
    settings = [word for setting in tiny for word in ("--set", setting)]
    settings += ["--set", "reduction.show=[]", "--set", "reduction.replay=[]"]
    said = installed("chimera-hpc", "run", "quickstart", *settings, "--cluster", "serial")
    assert "4 of 4 points run" in said
    assert "4 of 4 points done" in installed("chimera-hpc", "status", "results/quickstart")
    code = "import chimera_hpc; print(chimera_hpc.open('results/quickstart').sizes['point'])"
    assert installed("python", "-c", code) == "4\n"


def test_job_files_are_found_by_name_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    quickstart = jobs_folder() / "quickstart.toml"
    for name in ("quickstart", "quickstart.toml", "jobs/quickstart.toml", str(quickstart)):
        assert job_file(name) == quickstart
    assert job_file("paper/plane") == jobs_folder() / "paper/plane.toml"


def test_a_file_of_ones_own_comes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quickstart.toml").write_text("")
    (tmp_path / "quickstart").mkdir()
    assert job_file("quickstart.toml") == Path("quickstart.toml")
    assert job_file("quickstart") == jobs_folder() / "quickstart.toml"


def test_a_job_that_is_nowhere_stays_as_it_was_written():
    for name in ("nothing", "../quickstart", "jobs/slurm/array.sbatch", "quickstart.json"):
        assert job_file(name) == Path(name)


def test_the_shipped_schema_is_that_of_the_code():
    shipped = (jobs_folder() / FILE_NAME).read_text(encoding="utf-8")
    assert shipped == schema_text(), "python -m chimera_hpc.sweep schema > jobs/job.schema.json"
