"""A user's function that makes the networks of a job: parameters, streams, source, refusals."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import network_stream
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import model_folder, try_networks
from chimera_hpc.network.sweep_network import network_of
from chimera_hpc.run.second_draw import check_in_second_process
from chimera_hpc.store.origin import stored_origin
from chimera_hpc.store.provenance import differences, model_source
from chimera_hpc.store.store import Store

MODULE = '''
import random

import numpy as np

from chimera_hpc import Network

REACH = 1


def hub(n_nodes: int, spokes: int = 3, weight: float = 0.5, seed: int = 0) -> Network:
    """A ring with links from node 0 to `spokes` others, drawn at random."""
    rng = np.random.default_rng(seed)
    ends = 2 + rng.choice(n_nodes - 3, spokes, replace=False)
    ring = [(i, (i + REACH) % n_nodes, 1.0) for i in range(n_nodes)]
    return Network.from_edges([*ring, *((0, i, weight) for i in ends)])


def filled(n_nodes: int):
    return Network.ring(n_nodes, 2).with_triangles([(0, 1, 2)])


def by_chance(n_nodes: int):
    return Network.ring(n_nodes, 1).reorient_random(3, seed=random.randrange(2**30))


def matrix(n_nodes: int):
    return np.eye(n_nodes)


def words(n_nodes: int, rule: str = "hub", seed: int = 0):
    return Network.ring(n_nodes, 1)


def small(size: int = 7):
    return Network.ring(size, 1)


def fails(n_nodes: int):
    raise ValueError("no such brain")


ring = 3
'''


@pytest.fixture(autouse=True)
def _path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / f"{tmp_path.name}_own.py").write_text(MODULE)
    return tmp_path


def job(
    folder: Path, function: str = "hub", more: str = "", grid: str = "spokes = [2, 4]"
) -> Sweep:
    """A job file in a folder whose module no other test has."""
    text = f"""
name = "x"
model = "topological_fhn"
[network]
kind = "{folder.name}_own:{function}"
{more}
[grid]
{grid}
network_seed = 2
seeds = 2
[fixed]
n_nodes = 12
"""
    (folder / "job.toml").write_text(text)
    return Sweep.load(folder / "job.toml")


def test_parameters_of_the_function_are_axes_or_fixed(folder: Path) -> None:
    sweep = job(folder)
    assert sweep.points().axes == ("spokes", "network_seed", "seed")
    assert sweep.fixed["weight"] == 0.5
    assert type(sweep.fixed["weight"]) is float
    try_networks(sweep)
    counts = [network_of(sweep, sweep.points().row(i)).n_links for i in range(8)]
    assert counts == [14] * 4 + [16] * 4
    with pytest.raises(BadInput, match="unknown"):
        job(folder, grid="spook = [2, 4]")


def test_network_depends_on_parameters_and_network_seed_alone(folder: Path) -> None:
    sweep = job(folder)
    points = sweep.points()
    first = [network_of(sweep, points.row(i)) for i in range(4)]
    assert first[0] is first[1]
    assert first[0].digest != first[2].digest
    key = {"kind": sweep.network.kind, "n_nodes": 12, "network_seed": 0}  # type: ignore[union-attr]
    seed = int(network_stream({**key, "spokes": 2, "weight": 0.5}).integers(2**32))
    module = sys.modules[f"{folder.name}_own"]
    assert first[0].digest == module.hub(12, 2, 0.5, seed).digest


def test_triangles_of_the_function_are_taken_when_the_job_says_so(folder: Path) -> None:
    for words, count in (("given", 1), ("none", 0), ("cliques", 12)):
        sweep = job(folder, "filled", f'triangles = "{words}"', grid="b = 0.5")
        assert network_of(sweep, sweep.points().row(0)).n_triangles == count
    with pytest.raises(BadInput, match='"given" is for a file or a function of yours'):
        Sweep.from_dict(sweep.to_dict() | {"network": {"kind": "random", "triangles": "given"}})


def test_source_of_the_function_is_recorded_and_an_edit_is_seen(folder: Path) -> None:
    sweep = job(folder)
    before: dict[str, Any] = model_source(sweep)
    assert before["network"].startswith(f"{folder.name}_own:hub, source ")
    assert before["network_holds"][f"{folder.name}_own.REACH"] == "1"
    assert "numpy" in before["network_packages"]
    file = folder / f"{folder.name}_own.py"
    file.write_text(MODULE.replace("REACH = 1", "REACH = 2"))
    assert differences(before, model_source(sweep)) == [
        f"network: {before['network']} before, {model_source(sweep)['network']} now"
    ]


def test_store_knows_the_folder_and_can_be_read_without_the_module(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep = job(folder)
    assert model_folder(sweep) == str(folder)
    path = folder / "out" / "store.zarr"
    Store.plan(path, sweep)
    root = json.loads((path / "zarr.json").read_text())
    assert stored_origin(path, root).folders == (str(folder), str(folder / "out"))
    (folder / f"{folder.name}_own.py").unlink()
    again = Store.open(path)
    assert again.sweep.digest == sweep.digest
    assert again.points.row(3) == sweep.points().row(3)


def test_function_that_draws_by_itself_is_refused(folder: Path) -> None:
    check_in_second_process(job(folder))
    with pytest.raises(BadInput, match="must come from the argument seed"):
        check_in_second_process(job(folder, "by_chance", grid="b = 0.5"))


@pytest.mark.parametrize(
    ("function", "said"),
    [
        ("matrix", "returns 'ndarray': a Network is needed"),
        ("small", "makes 7 nodes, but n_nodes = 12: set it in"),
        ("fails", "does not work: ValueError: no such brain"),
        ("ring", "is not a function"),
        ("words", "parameter rule: str = 'hub': parameters are numbers"),
        ("none", "can't be imported: AttributeError"),
    ],
)
def test_what_is_no_maker_is_refused_in_one_line(folder: Path, function: str, said: str) -> None:
    with pytest.raises(BadInput, match=f"network.kind: .*{said}") as error:
        try_networks(job(folder, function, grid="b = 0.5"))
    assert "\n" not in str(error.value)


def test_module_that_does_not_exist_says_where_it_is_looked_for(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"No module named .*; it must be in the job's folder"):
        job(tmp_path)
