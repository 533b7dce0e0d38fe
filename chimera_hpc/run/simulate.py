"""One trajectory: the interface of the library to models, networks and the integrator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control, Outcome, integrate
from chimera_hpc.job import registry
from chimera_hpc.models.custom import OwnModel
from chimera_hpc.models.network_model import PhaseModel
from chimera_hpc.models.protocol import Model
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]
Form = Literal["reduced", "full"]
Signals = Literal["nodes", "links", "triangles"]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A sampled solution.

    Attributes
    ----------
    t : shape (T,)
        Sampling times, in the model's dimensionless units.
    u, w : shape (T, N)
        The two signals of the oscillators: u and w = D v of the topological model (w = B1 v for
        nodes); x and y of models with two variables; cosine and sine of phases.
    v : shape (T, N1), computed on demand
        Linear signals of the topological model (links, for nodes); of others all variables but the
        first.
    phase : shape (T, N)
        Phases of models of phases, in radians, not wrapped.
    status : Status
        DONE, or why it ended early; samples that were not reached are NaN.
    steps : int
        Accepted steps.
    """

    t: Array
    u: Array
    w: Array
    status: Status
    steps: int
    _rows: Array = field(repr=False)
    _v0: Array = field(repr=False)
    _model: Model = field(repr=False)

    @cached_property
    def v(self) -> Array:
        """Linear signals, shape (T, N1), by the exact formula in the reduced form."""
        return self._model.second_variable(self._rows, self._v0, self.t)

    @property
    def phase(self) -> Array:
        """Phases, shape (T, N), not wrapped. Raises AttributeError for a model without phases."""
        if not isinstance(self._model, PhaseModel):
            raise AttributeError(f"{self._model.name} has no phases; its signals are u and w")
        return self._rows.T


def simulate(
    system: Network | Model | OwnModel,
    *,
    u0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    phase0: ArrayLike | None = None,
    signals: Signals = "nodes",
    epsilon: float = 0.05,
    b: float = 0.5,
    c: float = -0.01,
    network: Network | None = None,
    parameters: Mapping[str, float] | None = None,
    t_end: float = 1000.0,
    t_step: float = 0.01,
    t_start: float = 0.0,
    rtol: float = 1e-3,
    atol: float = 1e-6,
    form: Form = "reduced",
    method: str = "tsit5",
    max_steps: int = 10_000_000,
    time_out: float = math.inf,
) -> Trajectory:
    """Integrate one trajectory from t = 0 and sample it on [t_start, t_end].

    Parameters
    ----------
    system : Network, model or OwnModel
        A network stands for the topological FitzHugh-Nagumo model on it with ``signals``,
        ``epsilon``, ``b``, ``c`` and ``form``, which models with parameters of their own don't
        read: `TopologicalFHN`, `NetworkedFHN`, `NetworkFHN`, `KuramotoSakaguchi`, `StuartLandau`,
        `SimplicialKuramoto`. An `OwnModel`, also one of the notebook, gets ``parameters`` and
        ``network``.
    u0 : shape (N,)
        Initial values of u: one for each node, link or triangle; the first variable of an OwnModel.
    v0 : shape (n_second,)
        Initial linear signals of the topological model: those on the simplices of one dimension
        less than u's, then those of one more (for nodes: the links). For other models all variables
        but the first; shape (n_variables - 1, N) is taken too.
    phase0 : shape (N,)
        Initial phases of a model of phases, in place of u0 and v0.
    signals : {"nodes", "links", "triangles"}
        Where u lives.
    network : Network
        Of an OwnModel with ``network=True``.
    parameters : mapping
        Of an OwnModel, by name; ``n_nodes`` too, without a network. The others have their defaults.
    t_end, t_step, t_start : float
        End of the run, sampling step, first sampling time.
    rtol, atol : float
        Tolerances of the error norm of HNW eq. II.4.11.
    form : {"reduced", "full"}
        Equations of u and w (exact, and 20 to 60 times cheaper), or of u and all linear signals.
    method : str
        A name in `chimera_hpc.job.registry.METHODS`.
    max_steps, time_out : int, float
        Budget of steps, and of wall time in seconds.

    Returns
    -------
    Trajectory

    Raises
    ------
    BadInput
        Wrong shapes, values that are not finite, numbers out of range, unknown form or method.

    Examples
    --------
    >>> topology = Network.ring(n_nodes=8, half_degree=3).reorient_node(0, 3)
    >>> simulate(topology, u0=np.zeros(8), v0=np.zeros(24), t_end=1.0, t_step=0.5).u.shape
    (3, 8)
    """
    if isinstance(system, Network):
        _check_numbers(epsilon, b, c, form)
        model: Model = TopologicalFHN(system, epsilon, b, c, form, signals)
    elif isinstance(system, OwnModel):
        model = _own_point(system, network, parameters or {})
    elif hasattr(system, "right_hand_side"):
        model = system
    else:
        raise BadInput(f"simulate: a Network, a model or an OwnModel is needed, not {system!r:.60}")
    if not isinstance(system, OwnModel) and not (network is None and parameters is None):
        raise BadInput("network and parameters belong to an OwnModel: this model has its own")
    first, second = _start(model, u0, v0, phase0)
    if method not in registry.METHODS | registry.REMOVED_METHODS:
        raise BadInput(f"method = {method!r}: allowed are {', '.join(registry.METHODS)}")
    tableau = registry.method(method)
    control = Control(t_end, t_start, t_step, rtol, atol, tableau, max_steps, time_out)
    _check(control)
    ends: list[tuple[Outcome, Array]] = []
    integrate(
        [model],
        [model.state(first, second)],
        control,
        model.n_rows,
        lambda _, end: ends.append((end, end.samples)),
    )
    (end, rows), times = ends[0], control.times
    rows[:, end.n_sampled :] = np.nan
    u, w = model.node_pair(rows)
    return Trajectory(times, u.T, w.T, end.status, end.steps, rows, second, model)


def _check_numbers(epsilon: float, b: float, c: float, form: str) -> None:
    if not (epsilon > 0.0 and all(map(math.isfinite, (epsilon, b, c)))):
        raise BadInput(
            f"epsilon = {epsilon}, b = {b}, c = {c}: finite numbers and epsilon > 0 are needed"
        )
    if form not in get_args(Form):
        raise BadInput(f"form = {form!r}: allowed are {', '.join(get_args(Form))}")


def _own_point(own: OwnModel, network: Network | None, given: Mapping[str, Any]) -> Model:
    table = own.parameters
    named = {p.name: p for p in table.parameters}
    unknown = [name for name in given if name not in named and name != "n_nodes"]
    if unknown:
        raise BadInput(f"parameters: {unknown[0]!r} is none of {', '.join(named)}, n_nodes")
    row: dict[str, Any] = {name: p.default for name, p in named.items()} | dict(given)
    for name, p in (named | {"n_nodes": table.n_nodes}).items():
        if name in row:
            if row[name] is None:
                raise BadInput(f"parameters: {name} is needed, it has no default")
            try:
                row[name] = p.check(row[name])
            except BadInput as error:
                raise BadInput(f"parameters: {name}: {error}") from None
    n_nodes = row.pop("n_nodes", table.n_nodes.default)
    return cast(Model, own.point(row, network.n_nodes if network else n_nodes, network=network))


def _start(
    model: Model, u0: ArrayLike | None, v0: ArrayLike | None, phase0: ArrayLike | None
) -> tuple[Array, Array]:
    if isinstance(model, PhaseModel):
        if phase0 is None or u0 is not None or v0 is not None:
            raise BadInput(f"{model.name}: phase0 is needed, and neither u0 nor v0")
        return _vector("phase0", phase0, model.n_nodes), np.empty(0)
    if phase0 is not None:
        raise BadInput(f"{model.name} has no phases: give u0 and v0 instead of phase0")
    if u0 is None or (v0 is None and model.n_second):
        raise BadInput(
            f"{model.name}: u0 of shape ({model.n_nodes},) and v0 of shape ({model.n_second},) "
            "are needed"
        )
    second = np.empty(0) if v0 is None else np.asarray(v0, dtype=np.float64)
    if second.ndim == 2 and second.shape[1] == model.n_nodes:
        second = second.ravel()
    return _vector("u0", u0, model.n_nodes), _vector("v0", second, model.n_second)


def _check(control: Control) -> None:
    t_start, t_end, t_step = control.start, control.t_end, control.step
    finite = math.isfinite(t_end) and math.isfinite(t_step)
    if not (finite and 0.0 <= t_start <= t_end and t_end > 0.0 and t_step > 0.0):
        raise BadInput(
            f"t_start = {t_start}, t_end = {t_end}, t_step = {t_step}: finite numbers with "
            "0 <= t_start <= t_end, t_end > 0 and t_step > 0 are needed"
        )
    if not (control.rtol > 0.0 and control.atol > 0.0):
        raise BadInput(f"rtol = {control.rtol}, atol = {control.atol}: both must be above 0")
    if not (control.max_steps >= 1 and control.time_out > 0.0):
        raise BadInput(
            f"max_steps = {control.max_steps}, time_out = {control.time_out}: "
            "at least 1, and above 0, are needed"
        )


def _vector(name: str, values: ArrayLike, size: int) -> Array:
    vector = np.asarray(values, dtype=np.float64)
    if vector.shape != (size,):
        raise BadInput(f"{name} has shape {vector.shape}: needed is ({size},)")
    if not np.isfinite(vector).all():
        raise BadInput(f"{name} holds values that are not finite")
    return vector
