"""FitzHugh-Nagumo oscillators as topological signals on a ring (paper eqs. eq:eq1a, eq:eq1b)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.errors import BadInput
from chimera_hpc.integrate._jit import jit
from chimera_hpc.integrate.kernel import RIGHT_HAND_SIDE
from chimera_hpc.integrate.simd import (
    LANES,
    fma,
    last_of,
    load,
    load_at,
    load_some,
    splat,
    store,
    store_at,
    store_some,
)
from chimera_hpc.models.sliding import (
    changes_along,
    first_across,
    first_along,
    rest_across,
    stride_across,
)
from chimera_hpc.topology import Topology

Array = NDArray[np.float64]

THIRD = 1.0 / 3.0


@jit()
def _activator(u: Any, w: Any, rate: Any) -> Any:
    # With the signs turned: (u^3 / 3 - u + w) * -rate.
    return fma(u, fma(u * u, THIRD, -1.0), w) * (-1.0 * rate)


@jit()
def _recovery(u: Any, w: Any, source: Any, total: Any, width: Any, c: Any) -> Any:
    return fma(c, w, source) - fma(-width, u, total)


# (L0 u)_i = (2P + 1) u_i - sum_{|k| <= P} u_{i+k}, the sum being that of a sliding window.


@jit()
def _node(zero: Any, i: Any, total: Any, context: Any) -> None:
    y, dy, params, n, width, c, rate = context
    u, w = load(zero, y, i), load(zero, y, n + i)
    store(dy, i, _activator(u, w, rate))
    store(dy, n + i, _recovery(u, w, load(zero, params, 2 + i), total, width, c))


@jit()
def _reduced_across(zero: Any, y: Any, dy: Any, params: Any, ints: Any) -> None:
    # Node by node, in all lanes together.
    n, half = ints[0], ints[1]
    rate, c = load(zero, params, 0), load(zero, params, 1)
    context = (y, dy, params, n, 2.0 * half + 1.0, c, rate)
    total = first_across(zero, y, 0, n, half)
    for i in range(0, n - LANES + 1, LANES):
        total = stride_across(zero, y, 0, n, half, total, i, _node, context)
    rest_across(zero, y, 0, n, half, total, _node, context)


@jit()
def _reduced_along(y: Any, dy: Any, params: Any, ints: Any) -> None:
    # One trajectory, eight nodes at a time.
    n, half = ints[0], ints[1]
    rate, c = params[0, 0], params[1, 0]
    width = 2.0 * half + 1.0
    before = first_along(y, 0, n, half)
    for i in range(0, n, 8):
        x = changes_along(y, 0, n, half, i)
        total = before + x
        before = before + last_of(x)
        if i + 8 <= n:
            u, w = load_at(y, i), load_at(y, n + i)
            source = load_at(params, 2 + i)
            store_at(dy, i, _activator(u, w, rate))
            store_at(dy, n + i, _recovery(u, w, source, total, width, c))
        else:
            u, w = load_some(y, i, 0, n - i), load_some(y, n + i, 0, n - i)
            source = load_some(params, 2 + i, 0, n - i)
            store_some(dy, i, _activator(u, w, rate), n - i)
            store_some(dy, n + i, _recovery(u, w, source, total, width, c), n - i)


@jit()
def _full(like: Any, y: Any, dy: Any, params: Any, ints: Any) -> None:
    # Rows of y: u (n), then v of link i * P + (k - 1) between i and i + k; its orientation is the
    # sign in params: +1 when i is the tail.
    n, half = ints[0], ints[1]
    rate, b, c = load(like, params, 0), load(like, params, 1), load(like, params, 2)
    for i in range(n):
        u = load(like, y, i)
        store(dy, i, u - u * u * u * THIRD)
    for i in range(n):
        for k in range(1, half + 1):
            j = i + k if i + k < n else i + k - n
            link = i * half + k - 1
            sign = load(like, params, 3 + link)
            v = load(like, y, n + link)
            store(dy, j, load(like, dy, j) - sign * v)
            store(dy, i, load(like, dy, i) + sign * v)
            flow = sign * (load(like, y, j) - load(like, y, i))
            store(dy, n + link, b + c * v + flow)
    for i in range(n):
        store(dy, i, load(like, dy, i) * rate)


def reduced_rhs(y, dy, lane_params, int_params):  # type: ignore[no-untyped-def]
    """Right-hand side of the reduced form; ``lane_params`` rows: 1/epsilon, c, b s_1 ... b s_N."""
    if y.shape[1] == LANES:
        _reduced_across(splat(0.0), y, dy, lane_params, int_params)
    elif int_params[0] >= LANES:
        _reduced_along(y, dy, lane_params, int_params)
    else:
        _reduced_across(0.0, y, dy, lane_params, int_params)


def full_rhs(y, dy, lane_params, int_params):  # type: ignore[no-untyped-def]
    """Right-hand side of the node-link form; ``lane_params`` rows: 1/epsilon, b, c, link signs."""
    if y.shape[1] == LANES:
        _full(splat(0.0), y, dy, lane_params, int_params)
    else:
        _full(0.0, y, dy, lane_params, int_params)


@cache
def _compiled(form: str) -> Any:
    return jit(RIGHT_HAND_SIDE)(reduced_rhs if form == "reduced" else full_rhs)


@dataclass(frozen=True)
class TopologicalFHN:
    r"""One ring of topological FitzHugh-Nagumo oscillators with its parameters.

    The paper's equations (eqs. eq:eq1a, eq:eq1b), the node-link or "full" form, are

    .. math::
        \epsilon \dot u_i = u_i - u_i^3/3 - (B_1 v)_i, \qquad
        \dot v_j = b + c v_j + (B_1^\top u)_j

    with u on the N0 nodes and v on the N1 = N0 P links. The nodes see the links only through
    w = B_1 v, and the link equation is linear, so multiplying it by B_1 gives the exact reduced
    form

    .. math::
        \epsilon \dot u = u - u^3/3 - w, \qquad
        \dot w = b s + c w + L_0 u, \qquad s = B_1 1, \quad L_0 = B_1 B_1^\top

    of 2 N0 variables. The orientation enters through the divergence s alone. Time is in the
    paper's units (dimensionless).

    Parameters
    ----------
    topology : Topology
        The oriented ring.
    epsilon, b, c : float
        Time-scale separation, excitability, decay rate of the link signals.
    form : {"reduced", "full"}
        Which of the two sets of equations is integrated.

    Raises
    ------
    BadInput
        Unless epsilon > 0.
    """

    topology: Topology
    epsilon: float = 0.05
    b: float = 0.5
    c: float = -0.01
    form: Literal["reduced", "full"] = "reduced"

    name = "topological_fhn"

    def __post_init__(self) -> None:
        """Check the time scale."""
        if not self.epsilon > 0.0:
            raise BadInput(f"epsilon = {self.epsilon}: must be above 0")

    @property
    def n_nodes(self) -> int:
        """Number of oscillators N0."""
        return self.topology.n_nodes

    @property
    def n_rows(self) -> int:
        """Number of integrated variables: 2 N0, or N0 + N1 in full form."""
        links = self.n_nodes if self.form == "reduced" else self.topology.n_links
        return self.n_nodes + links

    @property
    def lane_group(self) -> tuple[Any, ...]:
        """What trajectories must share to run as lanes of one kernel call."""
        return (self.name, self.form, self.n_nodes, self.topology.half_degree)

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        return _compiled(self.form)

    @property
    def int_params(self) -> NDArray[np.int64]:
        """Integers that all lanes share: N0, P."""
        return np.array([self.n_nodes, self.topology.half_degree], dtype=np.int64)

    @cached_property
    def lane_params(self) -> Array:
        """This trajectory's column of parameters, shape (n_params,)."""
        rate = 1.0 / self.epsilon
        if self.form == "reduced":
            return np.concatenate([[rate, self.c], self.b * self.topology.divergence])
        return np.concatenate([[rate, self.b, self.c], self.topology.link_signs])

    def state(self, u: Array, v: Array) -> Array:
        """Integrated variables of a state given on nodes (N0,) and links (N1,)."""
        second = self.topology.gather_links(v) if self.form == "reduced" else v
        return np.concatenate([u, second])

    def node_pair(self, rows: Array) -> tuple[Array, Array]:
        """The two signals that live on nodes, u and w = B_1 v, from rows (n_rows, ...)."""
        u, second = rows[: self.n_nodes], rows[self.n_nodes :]
        return u, second if self.form == "reduced" else self.topology.gather_links(second)

    def links(self, w: Array, v0: Array, t: Array) -> Array:
        r"""Link signals that belong to a reduced run.

        With :math:`\Pi = I - B_1^\top L_0^+ B_1`, the projection on the cycle space,

        .. math::
            v(t) = B_1^\top L_0^+ w(t) - \tfrac{b}{c}\,\Pi 1 + e^{ct}\,\Pi (v(0) + \tfrac{b}{c} 1).

        Parameters
        ----------
        w : shape (T, N0)
        v0 : shape (N1,)
        t : shape (T,)

        Returns
        -------
        shape (T, N1)
        """
        # Here, since it takes a sixth of a second, which every worker would wait for.
        from scipy.special import exprel

        gradient = self.topology.spread_to_links(self.topology.solve_laplacian(w.T))
        cycles_v0 = self.topology.cycle_part(v0)
        cycles_one = self.topology.cycle_part(np.ones(self.topology.n_links))
        decay = np.exp(self.c * t)
        grown = t * exprel(self.c * t)
        drift = np.outer(cycles_v0, decay) + self.b * np.outer(cycles_one, grown)
        return np.asarray((gradient + drift).T)

    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array:
        """The link signals v, shape (T, N1), from rows (n_rows, T) and the initial v0."""
        second = rows[self.n_nodes :].T
        return self.links(second, v0, t) if self.form == "reduced" else second

    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]:
        """Homogeneous state (u, v) that initial conditions are drawn around.

        "upper" and "lower" are the stable equilibria u = +-sqrt(3), v = -b/c of an orientation
        with zero divergence (paper sec. The model); "origin" is u = v = 0, where the paper's
        simulations begin.
        """
        if which == "origin":
            return 0.0, 0.0
        return (3.0**0.5 if which == "upper" else -(3.0**0.5)), -self.b / self.c

    @property
    def n_second(self) -> int:
        """Number of second variables v in an initial state."""
        return self.topology.n_links
