"""The names ordered, chimera, disordered are the paper's; other systems have A, B, C."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Cut
from chimera_hpc.job import Sweep
from chimera_hpc.job.class_names import naming_rule, overridden
from chimera_hpc.job.shipped import jobs_folder
from chimera_hpc.reduction.quality import quality_warnings

JOBS = jobs_folder()


def rule(job: str, *overrides: str) -> object:
    return naming_rule(Sweep.load(JOBS / job, overrides))


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("features.preset=paper-printed",),
        ("features.n_peaks=8", "features.start=900"),
        ("fixed.n_nodes=60", "fixed.orientation=2"),
    ],
)
def test_the_papers_system_has_the_papers_names(overrides: tuple[str, ...]) -> None:
    assert rule("quickstart.toml", *overrides) == "triplet"
    assert rule("paper/plane.toml", *overrides[:1]) == "triplet"


@pytest.mark.parametrize(
    ("job", "overrides"),
    [
        ("paper/networked.toml", ("reduction.names=triplet",)),
        ("examples/small_world.toml", ()),
        ("examples/kuramoto_sakaguchi.toml", ()),
        ("quickstart.toml", ("network.signals=links",)),
        ("quickstart.toml", ("features.refine=sine-fit",)),
    ],
)
def test_other_systems_have_letters(job: str, overrides: tuple[str, ...]) -> None:
    assert rule(job, *overrides) == "letters"


def test_names_of_a_job_stay() -> None:
    assert rule("examples/small_world.toml", 'reduction.names=["a","b","c"]') == ("a", "b", "c")
    assert rule("quickstart.toml", 'reduction.names=["a","b","c"]') == ("a", "b", "c")


def test_a_preset_that_a_job_overrides_is_named() -> None:
    file = JOBS / "quickstart.toml"
    text = file.read_text().replace('preset = "default"', 'preset = "paper-printed"')
    (line,) = overridden(Sweep.from_toml_text(text).features)
    assert 'but the job itself sets window_reference = "ring", max_windows = 0, ' in line
    preset = "features.preset=paper-printed"
    assert overridden(Sweep.load(file, [preset]).features) == []
    (line,) = overridden(Sweep.load(file, [preset, "features.max_windows=6"]).features)
    assert "sets max_windows = 6:" in line


@pytest.mark.parametrize("of_chimera", [Status.STEADY, Status.DONE])
def test_classes_of_runs_at_rest_are_named(of_chimera: Status) -> None:
    sweep = Sweep.load(JOBS / "quickstart.toml")
    names = ("ordered", "chimera", "disordered")
    cut = Cut(np.array([0, 1, 2]), names, names, np.zeros((3, 3)), np.ones(3, dtype=np.int64), 1.0)
    unknown = {name: np.full(3, np.nan) for name in ("samples_per_period", "r_squared")}
    status = [Status.STEADY, of_chimera, Status.NO_WINDOW]
    slow, line = quality_warnings(sweep, status, {}, unknown, {3: cut})
    assert "maxima: they are too slow" in slow  # though they have a class
    silent = "chimera or disordered" if of_chimera == Status.STEADY else "disordered"
    assert line.startswith(f"no run of the class {silent} oscillates: runs at rest are clustered")
