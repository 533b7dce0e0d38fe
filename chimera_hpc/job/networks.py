"""Kinds of networks that a job may name in [network], with their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.own_networks import own_maker
from chimera_hpc.job.user_models import Origin
from chimera_hpc.models.parameters import RING_LIMIT, Column, Limit, ModelParameters, Parameter
from chimera_hpc.models.topological_fhn import PARAMETERS as ON_THE_RING
from chimera_hpc.network.complex import SIGNALS
from chimera_hpc.network.sweep_network import RING, RING_PARAMETERS, network_of

if TYPE_CHECKING:
    from chimera_hpc.job.network_table import NetworkTable
    from chimera_hpc.job.spec import Sweep

NETWORK_SEED = Parameter(
    "network_seed",
    int,
    0,
    "Number of the random network, or of its orientation; in [grid], a count n means 0..n-1.",
    low=0,
    high=2**63 - 1,
)
_FLIPS = Parameter("flips", int, 0, "Links reversed at random.", low=0, high=10**15)
_P = Parameter("P", int, None, "Links of a node to each side, of the ring it is made of.", low=1)
_SHARE = {"low": 0.0, "high": 1.0}

KINDS: dict[str, tuple[Parameter, ...]] = {
    RING: tuple(
        replace(p, default=0) if p.name == "Q" else p
        for p in ON_THE_RING.parameters
        if p.name in RING_PARAMETERS
    ),
    "lattice": (
        Parameter("columns", int, 1, "Nodes per row; 1: one dimension.", low=1),
        Parameter("periodic", int, 1, "1: periodic boundaries, 0: open ones.", low=0, high=1),
    ),
    "small_world": (_P, Parameter("rewire", float, 0.1, "Share of links rewired.", **_SHARE)),
    "scale_free": (Parameter("m", int, None, "Links of each new node.", low=1),),
    "random": (Parameter("mean_degree", float, None, "Mean number of links of a node.", low=0.0),),
    "modular": (
        Parameter("modules", int, None, "Number of groups, as equal in size as possible.", low=1),
        Parameter("p_in", float, None, "Probability of a link within a group.", **_SHARE),
        Parameter("p_out", float, None, "Probability of a link across groups.", **_SHARE),
    ),
    "two_populations": (
        Parameter("A", float, None, "Difference of the weights within and across.", -1.0, 1.0),
    ),
    "multiplex": (
        Parameter("layers", int, 2, "Rings, one above the other.", low=1),
        _P,
        Parameter("layer_coupling", float, 1.0, "Weight of the links between layers."),
    ),
    "file": (),
}
"""Parameters of each kind, axes or fixed; `network_seed` and `flips` belong to all but the ring."""

_LIMITS = {
    "P": RING_LIMIT,
    "m": Limit("m", (), lambda _, n: n - 1, "m must be smaller than n_nodes"),
    "mean_degree": Limit(
        "mean_degree", (), lambda _, n: n - 1, "a node has at most n_nodes - 1 links"
    ),
    "modules": Limit("modules", (), lambda _, n: n, "a group has at least one node"),
}
_TURNS = ("Q", "orientation", "flips", "flip_set")
"""Parameters that reverse links and do not change their number."""
_DIVISORS = {"columns": "n_nodes / columns rows", "layers": "layers of equal size"}


def kind_parameters(kind: str, origin: Origin | None = None) -> tuple[Parameter, ...]:
    """Return all parameters that a kind of network adds to a model.

    `origin` tells where the module of a kind ``module:function`` is looked for.
    """
    if kind == RING:
        return KINDS[kind]
    own = own_maker(kind, origin).parameters if ":" in kind else KINDS[kind]
    return (*own, NETWORK_SEED, _FLIPS)


def on_network(
    model: ModelParameters, table: NetworkTable | None, origin: Origin | None = None
) -> ModelParameters:
    """Return the parameters of a model on a network of [network], or on a ring without it.

    The network's parameters come first; those of the model's own ring are left out.
    """
    kind = RING if table is None else table.kind
    added = kind_parameters(kind, origin)
    own = tuple(p for p in model.parameters if p.name not in RING_PARAMETERS)
    names = {p.name for p in added}
    if clash := names & {p.name for p in own}:
        name = sorted(clash)[0]
        raise BadInput(f'network.kind: "{kind}" and the model both have a parameter {name}')
    n_nodes = model.n_nodes
    if table is not None and table.nodes:
        n_nodes = Parameter("n_nodes", int, table.nodes, n_nodes.text, table.nodes, table.nodes)
    elif kind != RING:
        n_nodes = Parameter("n_nodes", int, n_nodes.default, "Nodes of the network.", 1, 10**7)
    return ModelParameters(
        n_nodes=n_nodes,
        parameters=(*added, *own),
        limits=(*_limits(kind), *(x for x in model.limits if not _of_ring(x))),
        forms=model.forms,
    )


def _limits(kind: str) -> tuple[Limit, ...]:
    if kind == RING:
        return ON_THE_RING.limits
    if kind == "multiplex":
        text = "2 P must be smaller than the nodes of a layer"
        return (Limit("P", ("layers",), lambda x, n: (n // x["layers"] - 1) // 2, text),)
    return tuple(_LIMITS[p.name] for p in KINDS.get(kind, ()) if p.name in _LIMITS)


def _of_ring(limit: Limit) -> bool:
    return bool({limit.name, *limit.needs} & set(RING_PARAMETERS))


def observed_sizes(sweep: Sweep, columns: Mapping[str, Column]) -> NDArray[np.int64]:
    """Return the number of nodes, links or triangles that have a signal, for each point.

    Networks are made once for each combination of the parameters that decide the size.
    """
    table, n_points = sweep.network, len(columns["seed"])
    if table is None or table.signals == "nodes":
        return np.full(n_points, sweep.n_nodes)
    if table.sizes is not None:
        return np.full(n_points, table.sizes[SIGNALS.index(table.signals)])
    names = [name for name in distinct(sweep) if name not in _TURNS]
    first, of_point = groups_of(columns, names)
    plain = dict.fromkeys(_TURNS, 0) | {"orientation": 1}
    rows = [{name: column[i].item() for name, column in columns.items()} | plain for i in first]
    sizes = [network_of(sweep, row).size(table.signals) for row in rows]
    return np.array(sizes)[of_point]


def distinct(sweep: Sweep) -> list[str]:
    """Return the names of the parameters in which the networks of a sweep differ."""
    kind = RING if sweep.network is None else sweep.network.kind
    return [p.name for p in kind_parameters(kind, sweep.origin)]


def groups_of(
    columns: Mapping[str, Column], names: Sequence[str]
) -> tuple[list[int], NDArray[np.int64]]:
    """Return the first point of each combination of these columns, and that of each point."""
    table = np.stack([columns[name].astype(np.float64) for name in names])
    _, first, number = np.unique(table, axis=1, return_index=True, return_inverse=True)
    return first.tolist(), number.ravel()


def check_sizes(kind: str, n_nodes: int, values: Mapping[str, Any]) -> None:
    """Raise BadInput unless the nodes can be shared out evenly where the kind needs that.

    values: the values of each parameter.
    """
    if kind == "two_populations" and n_nodes % 2:
        raise BadInput(f"fixed.n_nodes: {n_nodes} is odd; two populations have an even number")
    for name, text in _DIVISORS.items():
        if name not in {p.name for p in KINDS.get(kind, ())}:
            continue
        for value in values[name]:
            if n_nodes % value:
                raise BadInput(f"{name}: {value} does not divide n_nodes = {n_nodes}: {text}")
            if name == "columns" and not _closes(n_nodes, value, values["periodic"]):
                raise BadInput(
                    f"columns: {value}, n_nodes = {n_nodes}: the sides of a periodic lattice are "
                    "at least 3"
                )


def _closes(n_nodes: int, columns: int, periodic: Any) -> bool:
    sides = [n_nodes // columns, *([columns] if columns > 1 else [])]
    return 1 not in periodic or min(sides) >= 3
