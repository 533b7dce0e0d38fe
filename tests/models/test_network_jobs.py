"""Models on networks in a job: what a point is built with, its frequencies, what shares a call."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from chimera_hpc import KuramotoSakaguchi, SimplicialKuramoto, StuartLandau
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.base.streams import network_stream
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.models.networked_fhn_network import NetworkFHN
from chimera_hpc.network.sweep_network import network_of
from chimera_hpc.run.block import run_block
from chimera_hpc.sweep import main

CLASSES = {
    "kuramoto_sakaguchi": KuramotoSakaguchi,
    "stuart_landau": StuartLandau,
    "simplicial_kuramoto": SimplicialKuramoto,
    "networked_fhn": NetworkFHN,
}


def sweep(model: str, **fixed: Any) -> Sweep:
    """Two seeds of a model on two small worlds."""
    return Sweep.from_dict(
        {
            "name": "x",
            "model": model,
            "network": {"kind": "small_world"},
            "grid": {"rewire": [0.2, 0.4], "seeds": 2},
            "fixed": {"n_nodes": 12, "P": 2, **fixed},
            "integrator": {"t_end": 20.0, "t_step": 0.05, "delta": 3.0},
            "features": {"start": 10.0, "n_peaks": 3, "n_overlap": 1, "groups": 2},
        }
    )


@pytest.mark.parametrize("name", CLASSES)
def test_points_are_models_on_their_networks(name):
    job = sweep(name)
    models = [build(job, job.points().row(i)) for i in range(4)]
    assert all(type(model) is CLASSES[name] for model in models)
    assert [model.name for model in models] == [name] * 4
    # Seeds of a cell share the network and a call, cells do not.
    assert models[0].network is models[1].network
    assert models[0].lane_group == models[1].lane_group != models[2].lane_group


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kuramoto_sakaguchi", "stuart_landau"])
def test_points_run(name):
    job = sweep(name, omega=6.0, coupling=0.2)
    result = run_block(job, job.points())
    assert set(result.status.tolist()) <= {int(Status.DONE), int(Status.STEADY)}
    together = run_block(job, job.points(), lanes=8)
    assert together.features.tobytes() == result.features.tobytes()


@pytest.mark.parametrize("name", ["kuramoto_sakaguchi", "stuart_landau", "simplicial_kuramoto"])
def test_frequencies_belong_to_the_seed(name):
    job = sweep(name, omega=2.0, width=0.5, frequencies=1)
    omegas = [np.asarray(build(job, job.points().row(i)).omega) for i in range(4)]
    np.testing.assert_array_equal(omegas[0], omegas[2])
    assert np.abs(omegas[0] - omegas[1]).min() > 0.0
    key = {"frequencies_of": name, "size": 12, "seed": int(job.points().row(0)["seed"])}
    expected = 2.0 + 0.5 * network_stream(key).standard_normal(12)
    np.testing.assert_array_equal(omegas[0], expected)
    same = sweep(name, omega=2.0, width=0.5)
    np.testing.assert_array_equal(build(same, same.points().row(0)).omega, np.full(12, 2.0))


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("kuramoto_sakaguchi", {"coupling": 0.3, "phase_lag": 0.7}),
        ("stuart_landau", {"coupling": 0.3, "phase_lag": 0.7, "growth": 1.2, "shear": 0.4}),
        ("networked_fhn", {"sigma": 0.3, "epsilon": 0.07, "b": 0.6, "phi": 1.1}),
    ],
)
def test_numbers_of_a_job_are_those_of_the_model(name, numbers):
    job = sweep(name, **numbers)
    model = build(job, job.points().row(0))
    assert {key: getattr(model, key) for key in numbers} == numbers


@pytest.mark.parametrize(
    ("rewire", "kernel"), [(0.0, "sliding sums"), (0.5, "sparse rows, 48 entries")]
)
def test_plan_says_how_a_slope_is_computed(tmp_path, capsys, rewire, kernel):
    job = tmp_path / "job.toml"
    job.write_text(
        'name = "x"\nmodel = "topological_fhn"\n[network]\nkind = "small_world"\n'
        f"[grid]\nrewire = [{rewire}]\nseeds = 2\n[fixed]\nn_nodes = 12\nP = 2\n"
    )
    assert main(["plan", str(job)]) == 0
    said = capsys.readouterr().out
    size = r"\d+ nodes, \d+ links"
    assert re.search(rf"network     small_world; the first point {size}, by {kernel}\n", said)


def test_phases_without_a_network_are_on_the_papers_ring():
    job = Sweep.from_dict(
        {
            "name": "x",
            "model": "kuramoto_sakaguchi",
            "grid": {"P": [2, 3], "seeds": 1},
            "fixed": {"n_nodes": 12, "Q": 0, "phase_lag": 1.4},
        }
    )
    models = [build(job, job.points().row(i)) for i in range(2)]
    assert [model.network.half_degree for model in models] == [2, 3]
    assert models[0].phase_lag == 1.4


@pytest.mark.slow
def test_phases_live_on_the_links_of_a_job_that_says_so():
    job = Sweep.from_dict(
        {
            "name": "x",
            "model": "simplicial_kuramoto",
            "network": {"kind": "small_world", "triangles": "cliques", "signals": "links"},
            "grid": {"coupling": [0.5], "seeds": 2},
            "fixed": {"n_nodes": 12, "P": 2, "omega": 6.0, "explosive": 1},
            "integrator": {"t_end": 20.0, "t_step": 0.05, "delta": 3.0},
            "features": {"start": 10.0, "n_peaks": 3, "n_overlap": 1, "groups": 2},
        }
    )
    model: Any = build(job, job.points().row(0))
    assert (model.order, model.n_nodes, model.explosive) == (1, 24, True)
    result = run_block(job, job.points())
    assert set(result.status.tolist()) <= {int(Status.DONE), int(Status.STEADY)}


def test_simplicial_model_takes_no_weights():
    job = {
        "name": "x",
        "model": "simplicial_kuramoto",
        "network": {"kind": "two_populations"},
        "grid": {"A": [0.2], "seeds": 1},
        "fixed": {"n_nodes": 12},
    }

    def first(job: dict[str, Any]) -> None:
        found = Sweep.from_dict(job)
        build(found, found.points().row(0))

    with pytest.raises(BadInput, match="simplicial_kuramoto knows no weights"):
        first(job)


MODULE = """
from chimera_hpc import OwnModel, Parameter

def rhs(y, dy, p, ints, network):
    n = ints[0]
    for lane in range(y.shape[1]):
        for i in range(n):
            pull = 0.0
            for e in range(network.indptr[i], network.indptr[i + 1]):
                pull += network.weights[e] * (y[network.indices[e], lane] - y[i, lane])
            dy[i, lane] = -p[0, lane] * y[n + i, lane] + 0.1 * pull
            dy[n + i, lane] = p[0, lane] * y[i, lane]

MODEL = OwnModel(
    rhs,
    variables=("x", "y"),
    parameters=[Parameter("omega", float, 6.0, "Frequency.")],
    network=True,
)
"""
JOB = """
name = "mine"
model = "own_on_networks:MODEL"
[network]
kind = "scale_free"
[grid]
m = [1, 2]
seeds = 2
[fixed]
n_nodes = 12
[integrator]
t_end = 20.0
t_step = 0.05
delta = 1.0
[features]
start = 10.0
n_peaks = 3
n_overlap = 1
"""


def test_own_model_runs_on_the_networks_of_a_job(tmp_path, monkeypatch):
    (tmp_path / "own_on_networks.py").write_text(MODULE)
    (tmp_path / "job.toml").write_text(JOB)
    monkeypatch.syspath_prepend(str(tmp_path))
    job = Sweep.load(tmp_path / "job.toml")
    models: list[Any] = [build(job, job.points().row(i)) for i in range(4)]
    assert models[0].int_params is models[1].int_params
    links = [network_of(job, job.points().row(i)).n_links for i in (0, 2)]
    assert links[0] < links[1]
    # How many integers there are, n_nodes, starts of 12 rows and their end, and both ends of links.
    assert [len(models[i].int_params) for i in (0, 2)] == [2 + 13 + 4 * n for n in links]
    result = run_block(job, job.points())
    assert set(result.status.tolist()) <= {int(Status.DONE), int(Status.STEADY)}
