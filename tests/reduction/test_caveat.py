"""Where the names of classes are those of another system, it is said."""

from __future__ import annotations

from chimera_hpc.job import Sweep
from chimera_hpc.job.shipped import jobs_folder
from chimera_hpc.reduction.caveat import caveats


def test_names_on_another_network_are_called_unchecked() -> None:
    job = jobs_folder() / "examples" / "small_world.toml"
    sweep = Sweep.load(job)
    (line,) = caveats(sweep)
    assert "not checked for the model topological_fhn on small_world networks" in line


def test_names_on_the_papers_ring_or_of_ones_own_have_no_caveat() -> None:
    assert caveats(Sweep.load(jobs_folder() / "quickstart.toml")) == []
    job = jobs_folder() / "examples" / "small_world.toml"
    assert caveats(Sweep.load(job, ['reduction.names=["a","b","c"]'])) == []


def test_names_on_another_model_are_called_unchecked() -> None:
    job = jobs_folder() / "paper" / "networked.toml"
    (line,) = caveats(Sweep.load(job, ["reduction.names=triplet"]))
    assert "not checked for the model networked_fhn:" in line
