"""The table [network]: kinds and their parameters, streams, files, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import networkx
import numpy as np
import pytest

from chimera_hpc import Network
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import (
    initial_stream_on_network,
    network_stream,
    orientation_stream,
)
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build, try_networks
from chimera_hpc.job.networks import KINDS
from chimera_hpc.network.sweep_network import MAKERS, NAMES, network_of, pairs_of
from chimera_hpc.run.block import run_block
from chimera_hpc.run.initial_state import initial_state
from chimera_hpc.store.schema import MISSING

SMALL: dict[str, Mapping[str, Any]] = {
    "lattice": {"columns": [1, 4]},
    "small_world": {"P": [1, 2], "rewire": [0.0, 0.5]},
    "scale_free": {"m": 2},
    "random": {"mean_degree": [2.0, 4.0]},
    "modular": {"modules": 3, "p_in": 0.8, "p_out": 0.1},
    "two_populations": {"A": [0.0, 0.2]},
    "multiplex": {"layers": [2, 3], "P": 1},
}


def job(kind: str = "small_world", **changes: Any) -> dict[str, Any]:
    """A job of a kind, with few points."""
    data: dict[str, Any] = {
        "name": "x",
        "model": "topological_fhn",
        "network": {"kind": kind},
        "grid": {**SMALL.get(kind, {}), "seeds": 2},
        "fixed": {"n_nodes": 12},
    }
    for key, value in changes.items():
        data[key] = {**data.get(key, {}), **value} if isinstance(value, Mapping) else value
    return data


def network(sweep: Sweep, point: int = 0) -> Network:
    return network_of(sweep, sweep.points().row(point))


def test_the_ring_is_the_network_of_a_job_without_the_table() -> None:
    plain = {"name": "x", "model": "topological_fhn", "grid": {"P": "2:4", "Q": "P"}}
    told = Sweep.from_dict({**plain, "network": {"kind": "ring"}})
    assert told.network is None
    assert told.to_dict() == Sweep.from_dict(plain).to_dict()
    assert "network" not in told.to_dict()
    assert told.pairs == "ring"


def test_every_kind_has_parameters_and_a_maker() -> None:
    assert {k: tuple(p.name for p in v) for k, v in KINDS.items() if k != "ring"} == NAMES
    assert set(MAKERS) == set(NAMES) - {"file"} == set(SMALL)


@pytest.mark.parametrize("kind", SMALL)
def test_points_of_every_kind_have_a_network(kind: str) -> None:
    sweep = Sweep.from_dict(job(kind))
    again = Sweep.from_dict(json.loads(json.dumps(sweep.to_dict())))
    assert again.digest == sweep.digest
    assert again == sweep
    points = sweep.points()
    assert {"network_seed", "flips"} <= set(points.columns)
    for point in range(len(points)):
        found = network(sweep, point)
        assert found.n_nodes == 12
        assert build(sweep, points.row(point)).n_nodes == 12


def test_kinds_are_those_of_the_library() -> None:
    def links(kind: str, grid: Mapping[str, Any]) -> Any:
        return network(Sweep.from_dict(job(kind, grid=grid))).links

    ring = Network.ring(12, 2).links
    np.testing.assert_array_equal(links("small_world", {"P": 2, "rewire": 0.0}), ring)
    np.testing.assert_array_equal(links("lattice", {"columns": 4}), Network.lattice((3, 4)).links)
    two = network(Sweep.from_dict(job("two_populations", grid={"A": 0.2})))
    assert two.digest == Network.two_populations(6, 0.2).digest
    layers = [Network.ring(6, 1)] * 2
    flat = network(Sweep.from_dict(job("multiplex", grid={"layers": 2})))
    assert flat.digest == Network.multiplex(layers, 1.0).digest


def test_points_share_a_network_unless_its_parameters_differ() -> None:
    grid = {"P": 2, "rewire": 0.5, "network_seed": 2, "seeds": 2}
    sweep = Sweep.from_dict(job(grid=grid))
    assert sweep.points().columns["network_seed"].tolist() == [0, 0, 1, 1]
    first, second, third, fourth = (network(sweep, point) for point in range(4))
    assert first is second
    assert third is fourth
    assert first.digest != third.digest
    fixed = Sweep.from_dict(job(grid={"P": 2, "rewire": 0.5}, fixed={"network_seed": 1}))
    assert network(fixed).digest == third.digest


def test_flips_reverse_links_of_the_same_network() -> None:
    plain, turned = (Sweep.from_dict(job(fixed={"flips": flips})) for flips in (0, 5))
    changed = (network(plain).links != network(turned).links).any(axis=1)
    assert changed.sum() == 5
    undone = network(turned).reorient(np.flatnonzero(changed))
    assert undone.digest == network(plain).digest


def test_triangles_are_those_of_the_network() -> None:
    table = {"kind": "small_world", "triangles": "cliques"}
    made = network(Sweep.from_dict(job(network=table, grid={"P": 2, "rewire": 0.0})))
    assert made.n_triangles == 12
    ring = {"kind": "ring", "triangles": "cliques"}
    sweep = Sweep.from_dict(job("ring", network=ring, grid={"P": 2, "Q": 1}))
    assert network(sweep).n_triangles == 12
    assert network(sweep).digest != made.digest  # its links at node 0 are reversed
    assert sweep.network is not None
    assert sweep.digest != Sweep.from_dict({**job("ring", grid={"P": 2, "Q": 1})}).digest


def test_streams_depend_on_network_and_seed_as_documented() -> None:
    key = {"kind": "small_world", "n_nodes": 12, "P": 2, "rewire": 0.5, "network_seed": 1}
    sweep = Sweep.from_dict(
        job(grid={"P": 2, "rewire": 0.5, "network_seed": [1]}, fixed={"flips": 3})
    )
    expected = Network.small_world(12, 2, 0.5, network_stream(key))
    expected = expected.reorient_random(3, orientation_stream({**key, "flips": 3}))
    assert network(sweep).digest == expected.digest
    row = sweep.points().row(1)
    u, v = initial_state(sweep, row, build(sweep, row))
    stream = initial_stream_on_network("topological_fhn", "small_world", (12, 24, 0), 1, 1)
    np.testing.assert_array_equal(np.concatenate([u, v]), 1e-3 * stream.uniform(-1.0, 1.0, 36))


def test_published_vectors_of_the_streams_of_networks() -> None:
    key = {"kind": "small_world", "n_nodes": 12, "P": 2, "rewire": 0.5, "network_seed": 1}
    streams = [
        network_stream(key),
        orientation_stream({**key, "flips": 3}),
        initial_stream_on_network("topological_fhn", "small_world", (12, 24, 0), 1, 1),
    ]
    assert [stream.bit_generator.random_raw() for stream in streams] == VECTORS


VECTORS = [8305331790075976597, 7864668895307635207, 9598298438844336463]


def write_edges(
    folder: Path, text: str = "0,1\n1,2\n2,3\n3,4\n4,5\n5,0\n", name: str = "a.csv"
) -> Path:
    (folder / name).write_text(text)
    return folder / name


def from_file(path: Path | str, **changes: Any) -> dict[str, Any]:
    data = job("file", network={"kind": "file", "file": str(path)}, **changes)
    del data["fixed"]["n_nodes"]
    return data


def test_a_file_gives_the_network_and_its_size(tmp_path: Path) -> None:
    sweep = Sweep.from_dict(from_file(write_edges(tmp_path)))
    assert sweep.n_nodes == 6
    np.testing.assert_array_equal(network(sweep).links, Network.ring(6, 1).links)


def test_a_file_is_found_next_to_its_job(tmp_path: Path, monkeypatch: Any) -> None:
    write_edges(tmp_path)
    text = 'name = "x"\nmodel = "topological_fhn"\n[network]\nkind = "file"\nfile = "a.csv"\n'
    (tmp_path / "job.toml").write_text(text)
    monkeypatch.chdir("/")
    assert Sweep.load(tmp_path / "job.toml").n_nodes == 6


def test_the_digest_of_a_sweep_follows_the_content_of_the_file_alone(tmp_path: Path) -> None:
    first = Sweep.from_dict(from_file(write_edges(tmp_path)))
    moved = Sweep.from_dict(from_file(write_edges(tmp_path, name="b.csv")))
    assert moved.digest == first.digest
    assert moved == first.model_copy()
    path = write_edges(tmp_path, "0,1\n1,2\n2,3\n3,4\n4,5\n5,1\n")
    changed = Sweep.from_dict(from_file(path))
    assert changed.digest != first.digest
    assert any(line.startswith("network.digest: ") for line in changed.explain_difference(first))
    with pytest.raises(BadInput, match="the file has changed since the sweep was planned"):
        network(Sweep.from_dict(first.to_dict()))
    path.unlink()
    stored = Sweep.from_dict(first.to_dict())  # a store can be read without the file
    assert stored.n_nodes == 6


@pytest.mark.slow
def test_a_block_of_points_runs_on_networks() -> None:
    sweep = Sweep.from_dict(
        job(
            grid={"P": [1, 2], "rewire": 0.5, "network_seed": 2, "seeds": 1},
            integrator={"t_end": 60.0},
            features={"start": 20.0},
        )
    )
    points = sweep.points()
    together = run_block(sweep, points)
    for i in range(len(points)):
        alone = run_block(sweep, points[[i]])
        np.testing.assert_array_equal(alone.features[0], together.features[i])
        np.testing.assert_array_equal(alone.scalars[0], together.scalars[i])


@pytest.mark.parametrize("pairs", ["ring", "links", "order", None])
def test_variations_are_over_the_pairs_of_the_job(pairs: str | None) -> None:
    measures = {} if pairs is None else {"pairs": pairs}
    sweep = Sweep.from_dict(job("two_populations", measures=measures))
    found = pairs_of(sweep, sweep.points().row(0))
    if pairs == "ring":
        assert found is None
    elif pairs == "order":
        assert found is not None
        assert found.tolist() == [[i, i + 1] for i in range(11)]
    else:
        np.testing.assert_array_equal(found, network(sweep).links)


def test_pairs_of_the_ring_may_be_its_links() -> None:
    plain = {"name": "x", "model": "topological_fhn", "grid": {"P": 2, "Q": 0}}
    assert pairs_of(Sweep.from_dict(plain), {}) is None
    sweep = Sweep.from_dict({**plain, "measures": {"pairs": "links"}})
    assert sweep.digest != Sweep.from_dict(plain).digest
    ring = Network.ring(50, 2)
    np.testing.assert_array_equal(pairs_of(sweep, sweep.points().row(0)), ring.links)


def test_no_chain_joins_the_parts_of_a_network() -> None:
    sweep = Sweep.from_dict(job("random", grid={"mean_degree": 0.5}, measures={"pairs": "order"}))
    with pytest.raises(BadInput, match=r'measures.pairs = "order": the network has \d+ components'):
        pairs_of(sweep, sweep.points().row(0))


def on(signals: str, **changes: Any) -> dict[str, Any]:
    table = {"kind": "small_world", "triangles": "cliques", "signals": signals}
    grid = {"P": [2, 3], "rewire": 0.0, "seeds": 2}
    short = {"integrator": {"t_end": 40.0}, "features": {"start": 20.0}}
    return job(network=table, grid=grid, **short, **changes)


@pytest.mark.parametrize(("signals", "sizes"), [("links", (24, 36)), ("triangles", (12, 36))])
def test_arrays_are_as_wide_as_the_largest_network(signals: str, sizes: tuple[int, int]) -> None:
    sweep = Sweep.from_dict(on(signals))
    points = sweep.points()
    assert sweep.observed(points).tolist() == np.repeat(sizes, 2).tolist()
    assert sweep.n_observed == max(sizes)
    made = run_block(sweep, points)
    for i, size in enumerate(np.repeat(sizes, 2).tolist()):
        assert made.series is not None
        assert (made.series[i][:, :size] != MISSING).all()
        assert (made.series[i][:, size:] == MISSING).all()
        assert np.isnan(made.features[i][:, size:]).all()
    small = Sweep.from_dict(on(signals) | {"grid": {"P": 2, "rewire": 0.0, "seeds": 2}})
    alone = run_block(small, small.points())
    assert small.n_observed == sizes[0]
    np.testing.assert_array_equal(alone.scalars, made.scalars[:2])
    np.testing.assert_array_equal(alone.features, made.features[:2, :, : sizes[0]])
    np.testing.assert_array_equal(alone.series, made.series[:2, :, : sizes[0]])


def test_neighbours_of_a_link_share_a_node_and_those_of_a_triangle_a_link() -> None:
    for signals, part in (("links", "links"), ("triangles", "triangles")):
        sweep = Sweep.from_dict(on(signals))
        row = sweep.points().row(0)
        nodes = [set(one) for one in getattr(network_of(sweep, row), part).tolist()]
        shared = 1 if signals == "links" else 2
        expected = {
            (i, j)
            for j in range(len(nodes))
            for i in range(j)
            if len(nodes[i] & nodes[j]) == shared
        }
        found = pairs_of(sweep, row)
        assert found is not None
        assert set(map(tuple, found.tolist())) == expected
        assert len(found) == len(expected)


def test_the_size_of_a_file_is_known_without_it(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    club = networkx.node_link_data(networkx.karate_club_graph(), edges="links")
    path.write_text(json.dumps(club))
    table = {"kind": "file", "file": str(path), "triangles": "cliques", "signals": "triangles"}
    data = {"name": "x", "model": "topological_fhn", "network": table}
    spec = Sweep.from_dict(data).to_dict()
    path.unlink()
    stored = Sweep.from_dict(spec)
    assert stored.network is not None
    assert stored.network.sizes == (34, 78, 45)
    assert stored.n_observed == 45


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"network": {"signals": "edges"}}, "network.signals = 'edges': "),
        ({"network": {"signals": "triangles"}}, 'network.signals: "triangles" needs triangles'),
        (
            {"network": {"signals": "links"}, "measures": {"pairs": "order"}},
            'measures.pairs: "order" is for signals = "nodes"',
        ),
        (
            {"network": {"signals": "links"}, "model": "networked_fhn"},
            "network",
        ),
        ({"network": {"kind": "smallworld"}}, "network.kind: 'smallworld' is unknown; did you"),
        ({"network": {"size": 3}}, "network.size: unknown key"),
        ({"network": {"kind": "file"}}, 'network.file: needed with kind = "file", and only with'),
        ({"network": {"file": "a.csv"}}, 'network.file: needed with kind = "file", and only with'),
        ({"network": {"kind": "file", "file": "no.csv"}}, "network.file: "),
        ({"network": {"triangles": "all"}}, "network.triangles = 'all': "),
        ({"grid": {"Q": 3}}, "grid.Q: unknown key"),
        ({"grid": {"rewire": 1.5}}, "grid.rewire: 1.5 is not a finite number from 0 up to 1"),
        ({"grid": {"P": 6}}, "grid.P: 6 is too large, at most 5 is allowed (2 P must be smaller"),
        ({"grid": {"network_seed": 0}}, "grid.network_seed: 0 is not an integer from 1"),
        ({"fixed": {"flips": -1}}, "fixed.flips: -1 is not an integer from 0"),
        ({"network": {"kind": "scale_free"}, "grid": {"P": 1}}, "grid.P: unknown key"),
        ({"reduction": {"analyses": ["basin"]}}, "reduction.analyses: basin is an analysis of the"),
        ({"measures": {"pairs": "nodes"}}, "measures.pairs = 'nodes': "),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput) as caught:
        Sweep.from_dict(job(**changes))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("lattice", {"grid": {"columns": [5]}}, "columns: 5 does not divide n_nodes = 12"),
        ("lattice", {"grid": {"columns": [6]}}, "columns: 6, n_nodes = 12: the sides of a period"),
        (
            "multiplex",
            {"grid": {"layers": 5}, "fixed": {"n_nodes": 18}},
            "layers: 5 does not divide n_nodes = 18",
        ),
        ("multiplex", {"grid": {"layers": 4, "P": 2}}, "grid.P: 2 is too large, at most 1 is all"),
        ("multiplex", {"grid": {"layers": 3, "P": 2}}, "grid.P: 2 is too large, at most 1 is all"),
        ("two_populations", {"fixed": {"n_nodes": 13}}, "fixed.n_nodes: 13 is odd"),
        ("scale_free", {"grid": {"m": 12}}, "grid.m: 12 is too large, at most 11 is allowed"),
        ("random", {"grid": {"mean_degree": 12.0}}, "grid.mean_degree: 12.0 is too large, at mo"),
        ("modular", {"grid": {"modules": 13}}, "grid.modules: 13 is too large, at most 12 is"),
    ],
)
def test_sizes_that_do_not_fit_are_refused_at_the_plan(
    kind: str, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(BadInput) as caught:
        Sweep.from_dict(job(kind, **changes))
    assert message in str(caught.value)


def test_a_file_of_another_size_is_refused(tmp_path: Path) -> None:
    path = write_edges(tmp_path)
    with pytest.raises(BadInput, match=r"fixed\.n_nodes: 50, but .*a\.csv has 6 nodes"):
        Sweep.from_dict(from_file(path, fixed={"n_nodes": 50}) | {"fixed": {"n_nodes": 50}})


def test_networks_that_do_not_do_are_found_before_a_sweep_starts(tmp_path: Path) -> None:
    path = tmp_path / "directed.gml"
    ring = networkx.DiGraph([(i, (i + 1) % 8) for i in range(8)])
    networkx.write_gml(ring, path)
    with pytest.raises(BadInput, match=r"network with network_seed = 0, .*directed"):
        try_networks(Sweep.from_dict(from_file(path)))
    path = write_edges(tmp_path, "".join(f"{i},{i + 1},{1 - i}\n" for i in range(8)))
    with pytest.raises(BadInput, match=r"network with network_seed = 0, .* link 2 is -1\.0"):
        try_networks(Sweep.from_dict(from_file(path)))
    loose = job("random", grid={"mean_degree": [10.0, 0.5]}, measures={"pairs": "order"})
    with pytest.raises(BadInput, match=r"network with mean_degree = 0\.5, .*components"):
        try_networks(Sweep.from_dict(loose))
    try_networks(Sweep.from_dict(job()))


@pytest.mark.parametrize("kind", ["ring", "small_world"])
def test_a_users_model_gets_the_network(kind: str, monkeypatch: Any, tmp_path: Path) -> None:
    text = """
from chimera_hpc import OwnModel, Parameter
def rhs(y, dy, p, ints, network):
    pass
MODEL = OwnModel(rhs, variables=["x"], parameters=[Parameter("k", float, 1.0, "Strength.")],
                 network=True)
"""
    (tmp_path / f"networked_{kind}.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    made = job(kind, model=f"networked_{kind}:MODEL", grid={"P": 2, "seeds": 1})
    if kind == "ring":
        del made["network"]
    else:
        made["grid"]["rewire"] = 0.0
    sweep = Sweep.from_dict(made)
    assert sweep.pairs == ("ring" if kind == "ring" else "links")
    row = sweep.points().row(0)
    adjacency = Network.ring(12, 2).adjacency
    shared = build(sweep, row).int_params
    assert shared[1:3].tolist() == [12, 0]  # n_nodes, and where the rows of CSR begin
    assert adjacency.indices.tolist() == shared[15 : 15 + adjacency.nnz].tolist()


def test_other_models_live_on_the_ring_without_the_table() -> None:
    data = {"name": "x", "model": "kuramoto_sakaguchi", "grid": {"P": [2, 3]}}
    sweep = Sweep.from_dict(data)
    found = [network(sweep, point).digest for point in (0, 1)]
    assert found == [Network.ring(50, 2).digest, Network.ring(50, 3).digest]


def test_a_model_without_networks_says_so(monkeypatch: Any, tmp_path: Path) -> None:
    text = """
from chimera_hpc import OwnModel, Parameter
def rhs(y, dy, p, ints):
    pass
MODEL = OwnModel(rhs, variables=["x"], parameters=[Parameter("k", float, 1.0, "Strength.")])
"""
    (tmp_path / "lonely_model.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match="gets no network; OwnModel"):
        Sweep.from_dict(job(model="lonely_model:MODEL"))
