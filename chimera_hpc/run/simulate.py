"""One trajectory: the library's door to models and integrator."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control, Outcome, integrate
from chimera_hpc.job import registry
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.models.protocol import Model
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology

Array = NDArray[np.float64]
Form = Literal["reduced", "full"]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A sampled solution.

    Attributes
    ----------
    t : shape (T,)
        Sampling times, in the model's dimensionless units.
    u, w : shape (T, N0)
        Node signals; w = B1 v for the topological model, y for the networked one.
    v : shape (T, N1), computed on demand
        Link signals of the topological model (y of the networked one).
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
        """Link signals, shape (T, N1), by the exact formula in the reduced form."""
        return self._model.second_variable(self._rows, self._v0, self.t)


def simulate(
    system: Topology | NetworkedFHN | TopologicalFHN,
    *,
    u0: ArrayLike,
    v0: ArrayLike,
    epsilon: float = 0.05,
    b: float = 0.5,
    c: float = -0.01,
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
    system : Topology, TopologicalFHN or NetworkedFHN
        A topology stands for the topological FitzHugh-Nagumo model on it with ``epsilon``, ``b``,
        ``c`` and ``form``, which models with parameters of their own don't read.
    u0 : shape (N0,)
        Initial node signals.
    v0 : shape (N1,), for the networked model (N0,)
        Initial link signals.
    t_end, t_step, t_start : float
        End of the run, sampling step, first sampling time.
    rtol, atol : float
        Tolerances of the error norm of HNW eq. II.4.11.
    form : {"reduced", "full"}
        Node equations (exact, and 20 to 60 times cheaper), or nodes and links as printed.
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
    >>> topology = Topology.ring(n_nodes=8, half_degree=3).reorient_node(0, 3)
    >>> simulate(topology, u0=np.zeros(8), v0=np.zeros(24), t_end=1.0, t_step=0.5).u.shape
    (3, 8)
    """
    if isinstance(system, Topology):
        if not (epsilon > 0.0 and all(map(math.isfinite, (epsilon, b, c)))):
            raise BadInput(
                f"epsilon = {epsilon}, b = {b}, c = {c}: finite numbers and epsilon > 0 are needed"
            )
        if form not in get_args(Form):
            raise BadInput(f"form = {form!r}: allowed are {', '.join(get_args(Form))}")
        model: Model = TopologicalFHN(system, epsilon, b, c, form)
    else:
        model = system
    first = _vector("u0", u0, model.n_nodes)
    second = _vector("v0", v0, model.n_second)
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
