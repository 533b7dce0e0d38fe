"""The models, and how a point of a sweep becomes one of them.

For developers: a model is one small file with a frozen dataclass that has what `Model` lists, one
line in `_BUILDERS`, and its table of parameters in `grid.parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.grid import Sweep
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.streams import initial_stream, topology_stream
from chimera_hpc.topology import Topology

Array = NDArray[np.float64]
Row = Mapping[str, int | float]


class Model(Protocol):
    """What the integrator and the task ask of a model with its parameters.

    ``right_hand_side`` is compiled with the signature `integrate.kernel.RIGHT_HAND_SIDE` and works on
    (rows, lanes); ``int_params`` are shared by the lanes of a call, ``lane_params`` is one lane's
    column. The first ``n_nodes`` rows are the observed signal u.
    """

    @property
    def name(self) -> str: ...
    @property
    def n_nodes(self) -> int: ...
    @property
    def n_rows(self) -> int: ...
    @property
    def n_second(self) -> int: ...
    @property
    def lane_group(self) -> tuple[Any, ...]: ...
    @property
    def right_hand_side(self) -> Any: ...
    @property
    def int_params(self) -> NDArray[np.int64]: ...
    @property
    def lane_params(self) -> Array: ...
    def state(self, u: Array, v: Array) -> Array: ...
    def node_pair(self, rows: Array) -> tuple[Array, Array]: ...
    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array: ...
    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]: ...


def stream_key(sweep: Sweep, row: Row) -> tuple[str, int, int, int, int, int]:
    """Return what the random streams of a point depend on: model, N0, orientation, P, Q, seed."""
    numbers = (sweep.n_nodes, row["orientation"], row["P"], row.get("Q", 0), row["seed"])
    n_nodes, orientation, half_degree, reoriented, seed = (int(number) for number in numbers)
    return sweep.model, n_nodes, orientation, half_degree, reoriented, seed


def _topological(sweep: Sweep, row: Row) -> TopologicalFHN:
    topology = Topology.ring(sweep.n_nodes, int(row["P"]), int(row["orientation"]))
    topology = topology.reorient_node(0, int(row["Q"]))
    flips = int(row["flips"])
    if flips:
        stream = topology_stream(*stream_key(sweep, row), flips)
        topology = topology.reorient_random(flips, stream)
    return TopologicalFHN(topology, row["epsilon"], row["b"], row["c"], sweep.integrator.form)


def _networked(sweep: Sweep, row: Row) -> NetworkedFHN:
    return NetworkedFHN(
        sweep.n_nodes, int(row["P"]), row["sigma"], row["epsilon"], row["b"], row["phi"]
    )


_BUILDERS = {"topological_fhn": _topological, "networked_fhn": _networked}


def build(sweep: Sweep, row: Row) -> Model:
    """Return the model of one point, from its row of columns."""
    return _BUILDERS[sweep.model](sweep, row)


def initial_state(sweep: Sweep, row: Row, model: Model) -> tuple[Array, Array]:
    """Draw the initial state (u, v) of a point.

    Uniform in the ball of radius ``delta`` around ``integrator.centre``: in the maximum norm every
    variable is ``centre + delta * U[-1, 1]``, u first, then v (paper sec. Method and results). In
    the Euclidean norm the direction is Gaussian and the radius ``delta * U**(1/n)``.

    Returns
    -------
    u : shape (N0,)
    v : shape (n_second,)
    """
    stream = initial_stream(*stream_key(sweep, row))
    size = model.n_nodes + model.n_second
    if sweep.integrator.ball == "maximum":
        offset = stream.uniform(-1.0, 1.0, size)
    else:
        direction = stream.standard_normal(size)
        radius = stream.uniform() ** (1.0 / size)
        offset = direction * (radius / np.sqrt(np.sum(direction * direction)))
    u, v = model.equilibrium(sweep.integrator.centre)
    centre = np.repeat([u, v], [model.n_nodes, model.n_second])
    state = centre + row["delta"] * offset
    return state[: model.n_nodes], state[model.n_nodes :]
