"""The network of one point of a sweep: from the job's table [network] and the point's parameters.

A point of a job without that table is on the paper's ring. Points that share a network share its
arrays: it is made once per process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import (
    network_stream,
    orientation_stream,
    stream_key,
    topology_stream,
)
from chimera_hpc.network.checks import Integers
from chimera_hpc.network.complex import SIGNALS
from chimera_hpc.network.network import Network

Numbers = Mapping[str, int | float]

RING = "ring"
RING_PARAMETERS = ("P", "Q", "orientation", "flips", "flip_set")
"""Parameters of the paper's ring; other kinds of networks have their own in their place."""


def network_of(sweep: Any, row: Numbers) -> Network:
    """Return the network of a point.

    sweep: has ``model``, ``n_nodes`` and ``network``, the job's table [network] or None; and
        ``own_network``, with ``names`` and ``make``, if the kind is a user's function.
    row: the parameters of the point by name, the seed among them.
    """
    table = sweep.network
    if table is None or table.kind == RING:
        ring = ring_of(sweep, row)
        if table is None:
            return ring
        return ring.with_triangles(_ring_cliques(ring.n_nodes, ring.half_degree))
    own = sweep.own_network if ":" in table.kind else None
    names = NAMES[table.kind] if own is None else own.names
    numbers = tuple((name, row[name]) for name in names)
    seeds = int(row["network_seed"]), int(row["flips"])
    return _made(table.kind, sweep.n_nodes, numbers, seeds, table.triangles, *_file(table), own)


def pairs_of(sweep: Any, row: Numbers) -> Integers | None:
    """Return the pairs over which a point's variations are taken, shape (M, 2).

    None stands for a node and the next around the ring. With u on links or triangles, a pair
    shares a node or a link.

    Raises
    ------
    BadInput
        For ``pairs = "order"``, a network that is not connected.
    """
    if sweep.pairs == RING:
        return None
    network = network_of(sweep, row)
    if sweep.pairs == "order":
        return _chain(network)
    return network.links if sweep.signals == "nodes" else _sharing(network, sweep.signals)


@lru_cache(maxsize=64)
def _sharing(network: Network, signals: str) -> Integers:
    """Return the pairs of links that share a node, or of triangles that share a link."""
    from scipy.sparse import triu

    sides = abs(network.with_weights(None).boundary(SIGNALS.index(signals)))
    common = triu(sides.T @ sides, 1, format="coo")
    return np.column_stack([common.row, common.col]).astype(np.int64)


@lru_cache(maxsize=64)
def _chain(network: Network) -> Integers:
    if network.n_components > 1:
        raise BadInput(
            f'measures.pairs = "order": the network has {network.n_components} components, which '
            'no chain of nodes should join: use "links"'
        )
    return np.column_stack([network.order[:-1], network.order[1:]])


def ring_of(sweep: Any, row: Numbers) -> Network:
    """Return the ring of a point, with its orientation and the links that are reversed."""
    orientation, reoriented = int(row.get("orientation", 1)), int(row.get("Q", 0))
    ring = _oriented_ring(sweep.n_nodes, int(row["P"]), orientation, reoriented)
    flips = int(row.get("flips", 0))
    if not flips:
        return ring
    stream = topology_stream(*stream_key(sweep.model, sweep.n_nodes, row), flips)
    among = ring.links_at(0) if int(row["flip_set"]) == 1 else None
    return ring.reorient_random(flips, stream, among)


@lru_cache(maxsize=4)
def _oriented_ring(n_nodes: int, half_degree: int, orientation: int, reoriented: int) -> Network:
    """The ring of a cell: its runs share one, with the matrices that it keeps."""
    return Network.ring(n_nodes, half_degree, orientation).reorient_node(0, reoriented)


def read_file(path: str | Path) -> tuple[Network, str]:
    """Return the network of a file, and the digest of the file's bytes (16 hexadecimal digits)."""
    network = Network.from_file(path)
    return network, blake2b(Path(path).read_bytes(), digest_size=8).hexdigest()


def _file(table: Any) -> tuple[str, str]:
    return (table.file, table.digest) if table.kind == "file" else ("", "")


@lru_cache(maxsize=16)
def _ring_cliques(n_nodes: int, half_degree: int) -> Integers:
    found = Network.ring(n_nodes, half_degree).with_triangles("cliques").triangles
    assert found is not None
    return found


@lru_cache(maxsize=64)
def _made(
    kind: str,
    n_nodes: int,
    numbers: tuple[tuple[str, int | float], ...],
    seeds: tuple[int, int],
    triangles: str,
    file: str,
    digest: str,
    own: Any,
) -> Network:
    network_seed, flips = seeds
    key = {"kind": kind, "n_nodes": n_nodes, "network_seed": network_seed, **dict(numbers)}
    if kind == "file":
        key["file"] = digest
        network = _from_file(file, digest, n_nodes)
    elif own is not None:
        network = own.make(n_nodes, dict(numbers), network_stream(key))
    else:
        network = MAKERS[kind](n_nodes, dict(numbers), network_stream(key))
    if flips:
        network = network.reorient_random(flips, orientation_stream({**key, "flips": flips}))
    if network.directed or triangles == "given":
        return network
    return network.with_triangles(triangles)


def _from_file(file: str, digest: str, n_nodes: int) -> Network:
    network, found = read_file(file)
    if found != digest:
        raise BadInput(f"{file}: the file has changed since the sweep was planned")
    if network.n_nodes != n_nodes:
        raise BadInput(f"{file} has {network.n_nodes} nodes, but n_nodes = {n_nodes}")
    return network


def parts_of(n_nodes: int, count: int) -> list[int]:
    """Return `count` sizes that differ by at most one and add up to n_nodes."""
    return [len(part) for part in np.array_split(np.arange(n_nodes), count)]


Maker = Callable[[int, dict[str, Any], np.random.Generator], Network]


def _lattice(n: int, p: dict[str, Any], _: np.random.Generator) -> Network:
    shape = (n // p["columns"], p["columns"]) if p["columns"] > 1 else (n,)
    return Network.lattice(shape, periodic=bool(p["periodic"]))


def _modular(n: int, p: dict[str, Any], stream: np.random.Generator) -> Network:
    return Network.modular(parts_of(n, p["modules"]), p["p_in"], p["p_out"], stream)


def _multiplex(n: int, p: dict[str, Any], _: np.random.Generator) -> Network:
    layer = Network.ring(n // p["layers"], p["P"])
    return Network.multiplex([layer] * p["layers"], p["layer_coupling"])


NAMES: dict[str, tuple[str, ...]] = {
    "lattice": ("columns", "periodic"),
    "small_world": ("P", "rewire"),
    "scale_free": ("m",),
    "random": ("mean_degree",),
    "modular": ("modules", "p_in", "p_out"),
    "two_populations": ("A",),
    "multiplex": ("layers", "P", "layer_coupling"),
    "file": (),
}
"""Kinds of networks other than the ring, and the parameters of each; all have network_seed and
flips as well."""

MAKERS: dict[str, Maker] = {
    "lattice": _lattice,
    "small_world": lambda n, p, stream: Network.small_world(n, p["P"], p["rewire"], stream),
    "scale_free": lambda n, p, stream: Network.scale_free(n, p["m"], stream),
    "random": lambda n, p, stream: Network.random(n, p["mean_degree"], stream),
    "modular": _modular,
    "two_populations": lambda n, p, _: Network.two_populations(n // 2, p["A"]),
    "multiplex": _multiplex,
}
