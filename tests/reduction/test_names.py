"""The names ordered, chimera, disordered are the paper's; other systems have A, B, C."""

from __future__ import annotations

import pytest
from chimera_hpc.reduction.names import naming_rule

from chimera_hpc.job import Sweep
from chimera_hpc.job.shipped import jobs_folder

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
