"""A user's model, ``model = "module:object"`` in a job, from a right-hand side and a few names.

The module that a job names holds an `OwnModel`. It defines the axes that the job may have, the
random initial states, and one `OwnPoint` for each point. The integrator, the store and the
executors need nothing else.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import compile_uncached
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.models.own_network import compile_with_network, with_network
from chimera_hpc.models.parameters import Limit, ModelParameters, Parameter
from chimera_hpc.network.network import Network

__all__ = ["Limit", "OwnModel", "OwnPoint", "Parameter"]

Array: TypeAlias = NDArray[np.float64]
Row: TypeAlias = Mapping[str, int | float]
Prepare: TypeAlias = Callable[[Row, int], ArrayLike]
Initial: TypeAlias = Callable[[np.random.Generator, Row, int], ArrayLike]
Observe: TypeAlias = Callable[[Array], tuple[ArrayLike, ArrayLike]]

ARGUMENTS = ("y", "dy", "p", "ints")
"""Arguments of a right-hand side. The order is fixed, the names are free."""


class OwnModel:
    r"""A model of N oscillators with n variables each, \dot y = f(y; p).

    The right-hand side is a plain function with a fixed signature. It computes several runs at
    once, its *lanes*, which differ in state and real parameters and share the integers:

        def rhs(y, dy, p, ints):
            n = ints[0]
            for lane in range(y.shape[1]):
                for i in range(n):
                    dy[i, lane] = p[0, lane] - y[i, lane]

    Row ``v * n_nodes + i`` of ``y`` and ``dy`` is variable v of node i. The model compiles the
    function with numba: strict IEEE arithmetic, no memory allocation, no cache on disk. A process
    therefore always runs the current source.

    Parameters
    ----------
    right_hand_side : function (y, dy, p, ints)
        ``y``, ``dy`` (n_variables * n_nodes, lanes) and ``p`` (n_p, lanes) are float64, ``ints`` is
        int64. The function sets all of ``dy`` and changes nothing else. If it is jitted already, it
        is compiled again from its source.
    variables : sequence of str
        Names of the variables of a node.
    parameters : sequence of Parameter
        What a job may set in [grid] or [fixed], with defaults and bounds. Unless ``reals`` or
        ``integers`` say otherwise, the real ones are the rows of ``p`` and the integer ones follow
        n_nodes in ``ints``, both in this order.
    n_nodes : int
        Number of nodes if a job does not set it.
    initial : function (rng, row, n_nodes) -> (n_variables, n_nodes), optional
        Initial state from a `numpy.random.Generator` and the point's parameters by name (``delta``
        and ``seed`` included). Default: every variable uniform in the ball of ``integrator.delta``
        around 0.
    observed : (name, name), name, or function (state) -> (u, w), optional
        The signal u that is stored and measured, and a second one w for portraits and the order
        parameter; ``state`` is (n_variables, n_nodes, times), u and w are (n_nodes, times).
        Default: the first two variables; with a single name w is u.
    reals : function (row, n_nodes) -> (n_p,), optional
        The column of ``p`` of a run. It is computed once, e.g. cosines or a matrix of weights.
    integers : function (row, n_nodes) -> (k,), optional
        The numbers after n_nodes in ``ints``, e.g. shapes and lists of neighbours of a network.
    limits : sequence of Limit, optional
        Bounds of one parameter by others. They are checked for every point of a plan.
    network : bool, optional
        Whether the model lives on any network. The right-hand side then has a fifth argument
        ``network``, the links as CSR arrays (`own_network.Neighbours`), which all lanes share:

            for e in range(network.indptr[i], network.indptr[i + 1]):
                pull += network.weights[e] * (y[network.indices[e], lane] - y[i, lane])

    Raises
    ------
    BadInput
        Invalid or repeated names, parameters that are no numbers, or a function with wrong
        arguments.
    """

    def __init__(
        self,
        right_hand_side: Callable[..., Any],
        *,
        variables: Sequence[str],
        parameters: Sequence[Parameter] = (),
        n_nodes: int = 50,
        initial: Initial | None = None,
        observed: str | tuple[str, str] | Observe | None = None,
        reals: Prepare | None = None,
        integers: Prepare | None = None,
        limits: Sequence[Limit] = (),
        network: bool = False,
    ) -> None:
        self.function: Any = getattr(right_hand_side, "py_func", right_hand_side)
        self.variables = tuple(variables)
        self.initial, self.reals, self.integers = initial, reals, integers
        self.on_network = network
        _check_names(self.variables, parameters)
        _check_kinds(parameters)
        wanted = (*ARGUMENTS, "network") if network else ARGUMENTS
        _check_arguments("right_hand_side", self.function, wanted)
        _check_arguments("initial", initial, ("rng", "row", "n_nodes"))
        for name, function in (("reals", reals), ("integers", integers)):
            _check_arguments(name, function, ("row", "n_nodes"))
        self.observed = self._observed(observed)
        self.parameters = ModelParameters(
            n_nodes=Parameter("n_nodes", int, n_nodes, "Number of nodes.", low=3, high=10**7),
            parameters=tuple(parameters),
            limits=tuple(limits),
        )

    def _observed(self, observed: str | tuple[str, str] | Observe | None) -> Observe:
        if callable(observed):
            _check_arguments("observed", observed, ("state",))
            return observed
        names = (observed,) if isinstance(observed, str) else observed or self.variables[:2]
        for name in names:
            if name not in self.variables:
                raise BadInput(f"observed: {name!r} is none of {', '.join(self.variables)}")
        first, second = self.variables.index(names[0]), self.variables.index(names[-1])
        return lambda state: (state[first], state[second])

    def build(self, sweep: Any, row: Row) -> OwnPoint:
        """Return the model of one point, from its row of columns."""
        return self.point(row, int(sweep.n_nodes), sweep.model)

    def point(
        self, row: Row, n_nodes: int, name: str = "own", network: Network | None = None
    ) -> OwnPoint:
        """Return the model with the parameters ``row``, on a network if it has ``network=True``."""
        if self.on_network and network is None:
            raise BadInput(f"{name}: a network is needed, as the model has network=True")
        if network is not None and not self.on_network:
            raise BadInput(f"{name}: the model gets no network without OwnModel(network=True)")
        named = self.parameters.parameters
        reals: Any = [row[p.name] for p in named if p.kind is float]
        integers: Any = [row[p.name] for p in named if p.kind is int]
        if self.reals is not None:
            reals = self.reals(row, n_nodes)
        if self.integers is not None:
            integers = self.integers(row, n_nodes)
        shared = np.concatenate([[n_nodes], _flat("integers", integers, np.int64)])
        return OwnPoint(
            own=self,
            name=name,
            n_nodes=n_nodes,
            row=row,
            lane_params=_flat("reals", reals, np.float64),
            int_params=shared if network is None else with_network(tuple(shared), network),
        )

    @cached_property
    def compiled(self) -> Any:
        """The right-hand side, compiled at first use.

        Raises BadInput: the function does not compile, or it calls a function that numba caches on
        disk. Such a cache may be stale after an edit of what that function calls.
        """
        for helper in _helpers(self.function):
            # numba looks at the date of the helper's own file, not at what the helper calls.
            if helper.stats.cache_path is not None:
                raise BadInput(
                    f"right_hand_side calls {helper.__name__}, which is compiled with cache=True: "
                    "leave that out, or an edit may go unnoticed"
                )
        try:
            if self.on_network:
                return compile_with_network(self.function)
            return compile_uncached(RIGHT_HAND_SIDE, self.function)
        except Exception as error:
            # numba may raise any exception for a user's code.
            raise BadInput(f"right_hand_side does not compile: {_in_short(error)}") from None


@dataclass(frozen=True, eq=False)
class OwnPoint:
    """A user's model with the parameters of one point; it has what `protocol.Model` lists."""

    own: OwnModel
    name: str
    n_nodes: int
    row: Row
    lane_params: Array
    int_params: NDArray[np.int64]

    @property
    def n_rows(self) -> int:
        """Number of integrated variables."""
        return len(self.own.variables) * self.n_nodes

    @property
    def n_second(self) -> int:
        """Number of variables other than the first of each node."""
        return self.n_rows - self.n_nodes

    @property
    def lane_group(self) -> tuple[Any, ...]:
        """Key that trajectories must share to run as lanes of one kernel call."""
        shared = blake2b(self.int_params.tobytes(), digest_size=16).digest()
        return (self.name, shared, len(self.lane_params))

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        return self.own.compiled

    def draw(self, stream: np.random.Generator) -> tuple[Array, Array] | None:
        """Draw the initial state of the model: first variable, others; None without `initial`."""
        if self.own.initial is None:
            return None
        state = np.asarray(self.own.initial(stream, self.row, self.n_nodes), dtype=np.float64)
        wanted = (len(self.own.variables), self.n_nodes)
        if state.shape != wanted:
            raise BadInput(f"initial gives {state.shape} where (n_variables, n_nodes) is {wanted}")
        return state[0], state[1:].ravel()

    def state(self, u: Array, v: Array) -> Array:
        """Integrated variables of a state: first variable (N,), all others."""
        return np.concatenate([u, v])

    def node_pair(self, rows: Array) -> tuple[Array, Array]:
        """The observed signals u and w, both (N, ...), from rows (n_rows, ...)."""
        shape = (len(self.own.variables), self.n_nodes, *rows.shape[1:])
        u, w = self.own.observed(rows.reshape(shape))
        return np.asarray(u, dtype=np.float64), np.asarray(w, dtype=np.float64)

    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array:
        """The variables other than the first of each node, shape (T, n_second)."""
        return rows[self.n_nodes :].T

    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]:
        """Centre of the ball of initial states; "origin" is the only one."""
        if which != "origin":
            raise BadInput(f'integrator.centre = "{which}": a user\'s model knows "origin" only')
        return 0.0, 0.0


def _check_names(variables: tuple[str, ...], parameters: Sequence[Parameter]) -> None:
    named: dict[str, Sequence[Any]] = {
        "variables": variables,
        "parameters": [p.name for p in parameters],
    }
    for kind, names in named.items():
        wrong = [name for name in names if not (isinstance(name, str) and name.isidentifier())]
        if wrong or len(set(names)) < len(names):
            raise BadInput(f"{kind}: {', '.join(map(str, names))}: different names are needed")
    taken = {p.name for p in parameters} & {"n_nodes", "seed", "seeds", "delta"}
    if taken:
        raise BadInput(f"parameters: {', '.join(sorted(taken))}: every sweep has that already")
    if not variables:
        raise BadInput("variables: a node has at least one")


def _check_kinds(parameters: Sequence[Parameter]) -> None:
    for p in parameters:
        if p.kind not in (int, float):
            kind = getattr(p.kind, "__name__", p.kind)
            raise BadInput(
                f"parameter {p.name} is of kind {kind}, and parameters are numbers: give each word "
                f'a number, Parameter("{p.name}", int, 0, "0 one, 1 the other", low=0, high=1), or '
                "make one model for each"
            )


def _check_arguments(name: str, function: Any, wanted: tuple[str, ...]) -> None:
    if function is None:
        return
    if not callable(function):
        raise BadInput(f"{name}: a function ({', '.join(wanted)}) is needed, not {function!r}")
    found = inspect.signature(function).parameters.values()
    plain = [p for p in found if p.kind is p.POSITIONAL_OR_KEYWORD and p.default is p.empty]
    if len(plain) != len(wanted) or len(plain) < len(found):
        given = ", ".join(map(str, found))
        raise BadInput(f"{name} takes ({given}) where ({', '.join(wanted)}) is needed")


def _flat(name: str, values: ArrayLike, kind: type[Any]) -> NDArray[Any]:
    found = np.asarray(values)
    numbers = found.ndim == 1 and (found.dtype.kind in "iuf" or found.size == 0)
    if not (numbers and np.isfinite(found).all() and np.array_equal(found.astype(kind), found)):
        what = "integers" if kind is np.int64 else "real numbers"
        raise BadInput(f"{name} must be a list of finite {what}, not {found.dtype} {found.shape}")
    return found.astype(kind)


def _helpers(function: Any, known: set[int] | None = None) -> Iterator[Any]:
    """Yield the jitted functions that a function calls, directly or indirectly."""
    known = set() if known is None else known
    names = inspect.getclosurevars(function)
    for value in (*names.globals.values(), *names.nonlocals.values()):
        if hasattr(value, "py_func") and hasattr(value, "stats") and id(value) not in known:
            known.add(id(value))
            yield value
            yield from _helpers(value.py_func, known)


def _in_short(error: Exception) -> str:
    """Return the essential part of a numba error on one line."""
    noise = ("Failed in nopython mode", "During:", "Enable logging", "<source", "^")
    lines = [line.strip() for line in str(error).splitlines()]
    lines = [line for line in lines if line and not line.startswith(noise)]
    text = " ".join(" ".join(lines).split())
    if "_nrt" in text or "NRT" in text:
        text = "it makes arrays; use rows of p, or numbers, instead"
    name = type(error).__name__
    return f"{name}: {text if len(text) <= 300 else text[:297] + '...'}"
