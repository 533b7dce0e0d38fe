"""Models from outside of the package: ``model = "module:object"`` in a job."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest
from jobs_for_tests import SMALL, job_text

from chimera_hpc.sweep import main

MODULE = """
from chimera_hpc.models.parameters import ModelParameters, Parameter
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology

class Ring(TopologicalFHN):
    {extra}

class Mine:
    parameters = ModelParameters(
        n_nodes=Parameter("n_nodes", int, 10, "Nodes.", low=3),
        parameters=(Parameter("pull", float, None, "A parameter.", above=0),),
    )

    def build(self, sweep, row):
        return Ring(Topology.ring(sweep.n_nodes, 2, 1).reorient_node(0, 2), row["pull"])

MINE = Mine()
"""
JOB = SMALL | {
    "name": "mine",
    "grid.P": None,
    "grid.Q": None,
    "grid.pull": [0.04, 0.05],
    "grid.seeds": 3,
    "fixed.n_nodes": None,
    "integrator.t_end": 30.0,
    "features.start": 10.0,
    "run.block": None,
}
numbers = itertools.count()


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Write a module of a name of its own, and a job that uses it."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(text: str = MODULE, extra: str = "pass", name: str = "MINE") -> Path:
        module = f"own_model_{next(numbers)}"
        (tmp_path / f"{module}.py").write_text(text.replace("{extra}", extra))
        job = tmp_path / "job.toml"
        job.write_text(job_text(JOB, {"model": f"{module}:{name}"}))
        return job

    return write


@pytest.mark.slow
def test_own_model_is_run_and_stored_like_a_built_in_one(
    make: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = str(make())
    assert main(["plan", job]) == 0
    out = str(tmp_path / "out")
    assert main(["run", job, "--out", out, "--cluster", "serial", "--no-figures"]) == 0
    capsys.readouterr()
    assert main(["why", out, "pull=0.04", "seed=2"]) == 0
    assert "pull=0.04 seed=2" in capsys.readouterr().out
    assert main(["verify", out, "--stored", "--sample", "0.5"]) == 0


@pytest.mark.parametrize(
    ("extra", "name", "message"),
    [
        ("pass", "NOTHING", "can't be imported: AttributeError"),
        ("pass", "Ring", "has no attribute parameters of type ModelParameters"),
        ("oops", "MINE", "can't be imported: NameError: name 'oops' is not defined"),
        ("n_rows = 21", "MINE", "state(u, v) is (20,) where (21,) is needed"),
        ("right_hand_side = print", "MINE", "right_hand_side is not compiled as"),
        (
            "def node_pair(self, rows): return rows, rows",
            "MINE",
            "node_pair(rows)[0] is (20, 1) where (10, 1) is needed",
        ),
        (
            "def state(self, u, v): return 1 / 0",
            "MINE",
            "does not work: ZeroDivisionError: division by zero",
        ),
        (
            "def state(self, u, v): return super().state(u, v) * float('nan')",
            "MINE",
            "the initial state is not finite",
        ),
    ],
)
def test_what_is_wrong_with_an_own_model_is_said_when_it_is_planned(
    extra: str,
    name: str,
    message: str,
    make: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["plan", str(make(extra=extra, name=name))]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("model", ["no_such_package:x", ":x", "a b:c", "a:", "os:path:join"])
def test_names_that_lead_nowhere_are_refused(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = tmp_path / "job.toml"
    job.write_text(job_text(JOB, {"model": model}))
    assert main(["plan", str(job)]) == 2
    assert "model: " in capsys.readouterr().err
