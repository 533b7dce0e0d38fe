"""FitzHugh-Nagumo oscillators as topological signals on a ring (paper eqs. eq:eq1a, eq:eq1b)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import exprel

from chimera_hpc.errors import BadInput
from chimera_hpc.integrate._jit import jit
from chimera_hpc.integrate.kernel import RIGHT_HAND_SIDE
from chimera_hpc.integrate.simd import (
    LANES,
    add_shifted,
    fold,
    last_of,
    load,
    load_at,
    load_some,
    splat,
    store,
    store_at,
    store_some,
)
from chimera_hpc.topology import Topology

Array = NDArray[np.float64]

THIRD = 1.0 / 3.0


@jit()
def _activator(u: Any, w: Any, rate: Any) -> Any:
    return (u - u * u * u * THIRD - w) * rate


@jit()
def _recovery(u: Any, w: Any, source: Any, total: Any, width: Any, c: Any) -> Any:
    return source + c * w + (width * u - total)


# (L0 u)_i = (2P + 1) u_i - sum_{|k| <= P} u_{i+k}. The window slides along the ring once, in
# strides of eight nodes: the changes u_{i+P} - u_{i-P-1} add up within a stride (`simd.SCAN`),
# then to the window's sum before it. A step costs the same for every P, and eight nodes of one
# trajectory can go together as eight trajectories do, with the same additions in the same order.


@jit()
def _change(zero: Any, y: Any, n: Any, half: Any, i: Any) -> Any:
    ahead, behind = i + half, i - half - 1
    ahead = ahead - n if ahead >= n else ahead
    behind = behind + n if behind < 0 else behind
    return load(zero, y, ahead) - load(zero, y, behind)


@jit()
def _node(
    zero: Any, y: Any, dy: Any, params: Any, n: Any, i: Any, total: Any, width: Any, c: Any,
    rate: Any,
) -> None:  # fmt: skip
    u, w = load(zero, y, i), load(zero, y, n + i)
    store(dy, i, _activator(u, w, rate))
    store(dy, n + i, _recovery(u, w, load(zero, params, 2 + i), total, width, c))


@jit()
def _around(zero: Any, y: Any, n: Any, i: Any) -> Any:
    return load(zero, y, i if i < n else i - n)


@jit()
def _first_window(zero: Any, y: Any, n: Any, half: Any) -> Any:
    # The window of node -1: eight sums in turn, folded as in `simd.fold`.
    s0, s1, s2, s3, s4, s5, s6, s7 = zero, zero, zero, zero, zero, zero, zero, zero
    start, end = n - half - 1, n + half
    whole = end - (2 * half + 1) % 8
    for i in range(start, whole, 8):
        s0 = s0 + _around(zero, y, n, i)
        s1 = s1 + _around(zero, y, n, i + 1)
        s2 = s2 + _around(zero, y, n, i + 2)
        s3 = s3 + _around(zero, y, n, i + 3)
        s4 = s4 + _around(zero, y, n, i + 4)
        s5 = s5 + _around(zero, y, n, i + 5)
        s6 = s6 + _around(zero, y, n, i + 6)
        s7 = s7 + _around(zero, y, n, i + 7)
    i, left = whole, end - whole
    s0 = s0 + _around(zero, y, n, i) if left > 0 else s0
    s1 = s1 + _around(zero, y, n, i + 1) if left > 1 else s1
    s2 = s2 + _around(zero, y, n, i + 2) if left > 2 else s2
    s3 = s3 + _around(zero, y, n, i + 3) if left > 3 else s3
    s4 = s4 + _around(zero, y, n, i + 4) if left > 4 else s4
    s5 = s5 + _around(zero, y, n, i + 5) if left > 5 else s5
    s6 = s6 + _around(zero, y, n, i + 6) if left > 6 else s6
    return ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))


@jit()
def _reduced_across(zero: Any, y: Any, dy: Any, params: Any, ints: Any) -> None:
    # Node by node, in all lanes together.
    n, half = ints[0], ints[1]
    rate, c = load(zero, params, 0), load(zero, params, 1)
    width = 2.0 * half + 1.0
    before = _first_window(zero, y, n, half)
    whole = n - n % 8
    for i in range(0, whole, 8):
        x0, x1 = _change(zero, y, n, half, i), _change(zero, y, n, half, i + 1)
        x1 = x1 + x0
        _node(zero, y, dy, params, n, i, before + x0, width, c, rate)
        _node(zero, y, dy, params, n, i + 1, before + x1, width, c, rate)
        x2, x3 = _change(zero, y, n, half, i + 2), _change(zero, y, n, half, i + 3)
        x3 = x3 + x2
        x2, x3 = x2 + x1, x3 + x1
        _node(zero, y, dy, params, n, i + 2, before + x2, width, c, rate)
        _node(zero, y, dy, params, n, i + 3, before + x3, width, c, rate)
        x4, x5 = _change(zero, y, n, half, i + 4), _change(zero, y, n, half, i + 5)
        x5 = x5 + x4
        x6, x7 = _change(zero, y, n, half, i + 6), _change(zero, y, n, half, i + 7)
        x7 = x7 + x6
        x6, x7 = x6 + x5, x7 + x5
        x4, x5, x6, x7 = x4 + x3, x5 + x3, x6 + x3, x7 + x3
        _node(zero, y, dy, params, n, i + 4, before + x4, width, c, rate)
        _node(zero, y, dy, params, n, i + 5, before + x5, width, c, rate)
        _node(zero, y, dy, params, n, i + 6, before + x6, width, c, rate)
        before = before + x7
        _node(zero, y, dy, params, n, i + 7, before, width, c, rate)
    i, left = whole, n - whole
    if left > 0:
        x0 = _change(zero, y, n, half, i)
        _node(zero, y, dy, params, n, i, before + x0, width, c, rate)
    if left > 1:
        x1 = _change(zero, y, n, half, i + 1) + x0
        _node(zero, y, dy, params, n, i + 1, before + x1, width, c, rate)
    if left > 2:
        x2 = _change(zero, y, n, half, i + 2)
        _node(zero, y, dy, params, n, i + 2, before + (x2 + x1), width, c, rate)
    if left > 3:
        x3 = _change(zero, y, n, half, i + 3) + x2
        x3 = x3 + x1
        _node(zero, y, dy, params, n, i + 3, before + x3, width, c, rate)
    if left > 4:
        x4 = _change(zero, y, n, half, i + 4)
        _node(zero, y, dy, params, n, i + 4, before + (x4 + x3), width, c, rate)
    if left > 5:
        x5 = _change(zero, y, n, half, i + 5) + x4
        _node(zero, y, dy, params, n, i + 5, before + (x5 + x3), width, c, rate)
    if left > 6:
        x6 = _change(zero, y, n, half, i + 6) + x5
        _node(zero, y, dy, params, n, i + 6, before + (x6 + x3), width, c, rate)


@jit()
def _load_ring(y: Any, i: Any, n: Any) -> Any:
    # Eight neighbours from node i on, 0 <= i < 2n, over the end of the ring.
    i = i - n if i >= n else i
    if i + 8 <= n:
        return load_at(y, i)
    return load_some(y, i, 0, n - i) + load_some(y, i - n, n - i, 8)


@jit()
def _reduced_along(y: Any, dy: Any, params: Any, ints: Any) -> None:
    # One trajectory, eight nodes at a time.
    n, half = ints[0], ints[1]
    rate, c = params[0, 0], params[1, 0]
    width = 2.0 * half + 1.0
    total = splat(0.0)
    left, i = 2 * half + 1, n - half - 1
    while left >= 8:
        total = total + _load_ring(y, i, n)
        i, left = i + 8, left - 8
        i = i - n if i >= n else i
    if left > 0:
        split = min(n - i, left)
        total = total + (load_some(y, i, 0, split) + load_some(y, i - n, split, left))
    before = fold(total)
    for i in range(0, n, 8):
        x = _load_ring(y, i + half, n) - _load_ring(y, i + n - half - 1, n)
        x = add_shifted(add_shifted(add_shifted(x, 0), 1), 2)
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
