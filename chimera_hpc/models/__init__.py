"""The models, and how a point of a sweep becomes one of them.

For developers: a model is one small file with a frozen dataclass that has what `Model` lists, one
line in `_BUILDERS`, and its table of parameters in `grid.parameters`. A user's own model needs no
line anywhere, see `models.user`; `check_user_model` tells what is wrong with one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from chimera_hpc.errors import BadInput
from chimera_hpc.grid import Sweep
from chimera_hpc.grid.parameters import short, user_model
from chimera_hpc.integrate.kernel import RIGHT_HAND_SIDE
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.models.user import OwnPoint
from chimera_hpc.streams import initial_stream, topology_stream
from chimera_hpc.topology import Topology

_config: Any = numba.config  # its attributes are made at run time
Array = NDArray[np.float64]
Row = Mapping[str, int | float]


class Model(Protocol):
    """What the integrator and the task ask of a model with its parameters.

    ``right_hand_side`` is compiled with the signature `integrate.kernel.RIGHT_HAND_SIDE` and works
    on (rows, lanes); ``int_params`` are shared by the lanes of a call, ``lane_params`` is one
    lane's column. The first ``n_nodes`` rows are the observed signal u.
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
    # A user's model need not know orientation, P or Q.
    ring = (row.get("orientation", 1), row.get("P", 0), row.get("Q", 0))
    numbers = (sweep.n_nodes, *ring, row["seed"])
    n_nodes, orientation, half_degree, reoriented, seed = (int(number) for number in numbers)
    return sweep.model, n_nodes, orientation, half_degree, reoriented, seed


def _topological(sweep: Sweep, row: Row) -> TopologicalFHN:
    topology = Topology.ring(sweep.n_nodes, int(row["P"]), int(row["orientation"]))
    topology = topology.reorient_node(0, int(row["Q"]))
    flips = int(row["flips"])
    if flips:
        stream = topology_stream(*stream_key(sweep, row), flips)
        among = topology.links_at(0) if int(row["flip_set"]) == 1 else None
        topology = topology.reorient_random(flips, stream, among)
    return TopologicalFHN(topology, row["epsilon"], row["b"], row["c"], sweep.integrator.form)


def _networked(sweep: Sweep, row: Row) -> NetworkedFHN:
    return NetworkedFHN(
        sweep.n_nodes, int(row["P"]), row["sigma"], row["epsilon"], row["b"], row["phi"]
    )


_BUILDERS: dict[str, Callable[[Sweep, Row], Model]] = {
    "topological_fhn": _topological,
    "networked_fhn": _networked,
}


def build(sweep: Sweep, row: Row) -> Model:
    """Return the model of one point, from its row of columns."""
    builder = _BUILDERS.get(sweep.model) or user_model(sweep.model).build
    model: Model = builder(sweep, row)
    return model


def check_user_model(sweep: Sweep, row: Row) -> None:
    """Build a user's model for one point and try all that `Model` lists.

    Raises
    ------
    BadInput
        With what is missing, or of the wrong kind or shape.
    """
    where = f"model: {short(sweep.model)}"
    try:
        model = build(sweep, row)
        _check_shapes(sweep, row, model)
        _check_right_hand_side(model, model.state(*initial_state(sweep, row, model)))
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    except Exception as error:
        # Whatever the user's code does.
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise BadInput(f"{where} does not work: {text}") from None


def _check_shapes(sweep: Sweep, row: Row, model: Model) -> None:
    u, v = initial_state(sweep, row, model)
    state = np.asarray(model.state(u, v))
    _expect("state(u, v)", state.shape, (model.n_rows,))
    _expect("n_nodes", model.n_nodes, sweep.n_nodes)
    hash(model.lane_group)
    if not np.isfinite(state).all():
        raise BadInput("the initial state is not finite")
    for i, signal in enumerate(model.node_pair(state[:, None])):
        _expect(f"node_pair(rows)[{i}]", signal.shape, (model.n_nodes, 1))
    second = model.second_variable(state[:, None], v, np.zeros(1))
    _expect("second_variable(rows, v0, t)", second.shape, (1, model.n_second))


def _check_right_hand_side(model: Model, state: Array) -> None:
    """Try it on one lane and on a pack of different ones: each must have the numbers it has alone.

    A lane that reads another's parameters, or vector functions that round otherwise than those for
    single numbers, would make results depend on the neighbours.
    """
    rhs, ints = model.right_hand_side, np.asarray(model.int_params, dtype=np.int64)
    if not (_config.DISABLE_JIT or RIGHT_HAND_SIDE in getattr(rhs, "nopython_signatures", [])):
        raise BadInput(f"right_hand_side is not compiled as {RIGHT_HAND_SIDE}")
    scale = 1.0 + 1e-3 * np.arange(LANES)
    rows = np.asarray(state, dtype=np.float64)[:, None] * scale
    params = np.asarray(model.lane_params, dtype=np.float64)[:, None] * scale
    together = np.full_like(rows, np.nan)
    before = rows.copy()
    rhs(rows, together, params, ints)
    if rows.tobytes() != before.tobytes():
        raise BadInput("the right-hand side changes the state y")
    for lane in range(LANES):
        alone = np.full((len(rows), 1), np.nan)
        rhs(rows[:, [lane]].copy(), alone, params[:, [lane]].copy(), ints)
        if lane == 0 and not np.isfinite(alone).all():
            row = int(np.flatnonzero(~np.isfinite(alone[:, 0]))[0])
            raise BadInput(
                f"the right-hand side is not finite in the initial state, or not set, in row {row}"
            )
        if alone[:, 0].tobytes() != together[:, lane].tobytes():
            raise BadInput(
                "the right-hand side gives a run other numbers beside others than alone: "
                "lane by lane, only its own columns of y, dy and p may be used"
            )


def _expect(what: str, found: Any, wanted: Any) -> None:
    if found != wanted:
        raise BadInput(f"{what} is {found} where {wanted} is needed")


def initial_state(sweep: Sweep, row: Row, model: Model) -> tuple[Array, Array]:
    """Draw the initial state (u, v) of a point.

    Uniform in the ball of radius ``delta`` around ``integrator.centre``: in the maximum norm every
    variable is ``centre + delta * U[-1, 1]``, u first, then v (paper sec. Method and results). In
    the Euclidean norm the direction is Gaussian and the radius ``delta * U**(1/n)``. A user's model
    may draw it otherwise, from the same stream.

    Returns
    -------
    u : shape (N0,)
    v : shape (n_second,)
    """
    stream = initial_stream(*stream_key(sweep, row))
    drawn = model.draw(stream) if isinstance(model, OwnPoint) else None
    if drawn is not None:
        return drawn
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
