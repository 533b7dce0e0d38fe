"""The examples on networks, thinned, through the whole pipeline; and a ring that a file gives."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc import Network, simulate
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import try_networks
from chimera_hpc.network.sweep_network import network_of
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

EXAMPLES = Path(__file__).resolve().parents[2] / "jobs" / "examples"
Run = Callable[..., Store]


@pytest.fixture(autouse=True)
def _path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run an example with settings; return its store."""

    def made(name: str, *settings: str, figures: str = "[]") -> Store:
        words = [w for text in (*settings, f"reduction.figures={figures}") for w in ("--set", text)]
        job, out = EXAMPLES / f"{name}.toml", tmp_path / name
        command = ["run", str(job), "--out", str(out), "--cluster", "serial", *words]
        assert main(command if figures != "[]" else [*command, "--no-figures"]) == 0
        return Store.open(out / "store.zarr")

    return made


@pytest.mark.parametrize("name", ["populations", "karate", "brain", "links", "scale_free"])
def test_networks_of_the_example_can_be_made(name: str) -> None:
    sweep = Sweep.load(EXAMPLES / f"{name}.toml")
    try_networks(sweep)
    assert len(sweep.points()) <= 100


@pytest.mark.slow
def test_brain_is_made_by_the_function_next_to_the_job(run: Run) -> None:
    short = (
        "integrator.t_end=60",
        "features.start=30",
        "features.n_peaks=3",
        "features.n_overlap=1",
        "n_nodes=24",
    )
    store = run("brain", "reach=[0.2, 0.4]", "network_seed=1", "seeds=2", *short)
    network = network_of(store.sweep, store.points.row(0))
    assert network.n_components == 1
    assert set(network.communities.tolist()) == {0, 1}
    assert main(["verify", str(store.path.parent), "--sample", "1"]) == 0
    record = json.loads(sorted((store.path / "runs").glob("*.json"))[0].read_text())
    assert record["network"].startswith("brain:brain, source ")


@pytest.mark.slow
def test_links_carry_u_and_have_their_pictures(run: Run) -> None:
    short = (
        "integrator.t_end=60",
        "features.start=30",
        "features.n_peaks=3",
        "features.n_overlap=1",
        "n_nodes=12",
    )
    settings = ("mean_degree=[4.0, 6.0]", "network_seed=1", "seeds=2", *short)
    store = run("links", *settings, figures='["network_state", "space_time"]')
    assert store.sizes.tolist() == [24, 24, 36, 36]
    folder = store.path.parent
    assert (folder / "figures" / "network_state.png").stat().st_size > 10_000
    page = (folder / "report.html").read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data = json.loads(found.group(1))
    assert [len(drawn["marks"]) for drawn in data["networks"]] == [24, 36]
    assert {plate["network"] for plate in data["plates"].values()} == {0, 1}
    assert "links, by community" in page
    film = ["--animate", str(folder / "film.gif"), "--periods", "0.2"]
    point = ["mean_degree=4", "seed=0"]
    assert main(["show", str(folder), *point, "--layout", "circular", *film]) == 0
    assert len(list((folder / "figures" / "show").glob("*-network.png"))) == 1
    assert (folder / "film.gif").is_file()


RING_OF_FILES = """
from pathlib import Path

from chimera_hpc import Network


def ring(n_nodes: int, P: int):
    return Network.from_file(Path(__file__).with_name(f"ring{P}.csv"))
"""
RING_JOB = """
name = "rings"
model = "topological_fhn"
[network]
kind = "ring_of_files:ring"
[measures]
pairs = "ring"
[grid]
P = [9, 12, 21]
seeds = 3
[reduction]
cuts = [3]
names = ["ordered", "chimera", "disordered"]
"""


def write_ring(folder: Path, half_degree: int) -> Network:
    """Write the links of a ring with Q = P, in any order, as an edge list."""
    ring = Network.ring(50, half_degree).reorient_node(0, half_degree)
    links = np.random.default_rng(0).permutation(ring.links)
    np.savetxt(folder / f"ring{half_degree}.csv", links, fmt="%d", delimiter=",")
    return ring


def test_ring_given_as_an_edge_list_has_the_signals_of_the_ring(tmp_path: Path) -> None:
    ring = write_ring(tmp_path, 12)
    listed = Network.from_file(tmp_path / "ring12.csv")
    new = np.random.default_rng(1).permutation(50)
    rng = np.random.default_rng(2)
    u0, v0 = rng.uniform(-1.0, 1.0, 50), rng.uniform(-1.0, 1.0, ring.n_links)
    place = {tuple(link): i for i, link in enumerate(ring.links.tolist())}
    same = [place[tuple(link)] for link in listed.links.tolist()]
    made = [
        simulate(network, u0=u, v0=v, t_end=5.0, t_step=0.1, rtol=1e-6, atol=1e-9).u
        for network, u, v in (
            (ring, u0, v0),
            (listed, u0, v0[same]),  # by sliding sums, as the ring
            (listed.relabel(new), u0[np.argsort(new)], v0[same]),  # by sparse rows
        )
    ]
    assert np.abs(made[1] - made[0]).max() < 1e-12
    assert np.abs(made[2][:, new] - made[0]).max() < 1e-12


@pytest.mark.slow
def test_ring_given_as_edge_lists_has_the_classes_of_the_ring(tmp_path: Path) -> None:
    for half_degree in (9, 12, 21):
        write_ring(tmp_path, half_degree)
    (tmp_path / "ring_of_files.py").write_text(RING_OF_FILES)
    (tmp_path / "rings.toml").write_text(RING_JOB)
    words = ["--out", str(tmp_path / "out"), "--cluster", "serial", "--no-figures"]
    assert main(["run", str(tmp_path / "rings.toml"), *words]) == 0
    cells = json.loads((tmp_path / "out" / "results.json").read_text())["cuts"]["3"]["cells"]
    # Those of the quick start.
    assert [cell["class"] for cell in cells] == ["ordered", "chimera", "disordered"]
