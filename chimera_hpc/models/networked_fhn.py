"""The classical networked FitzHugh-Nagumo model on a ring (paper eq. eq:FHNnet)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.errors import BadInput
from chimera_hpc.integrate._jit import jit
from chimera_hpc.integrate.kernel import RIGHT_HAND_SIDE
from chimera_hpc.integrate.simd import (
    LANES,
    fetch,
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

Array = NDArray[np.float64]

THIRD = 1.0 / 3.0
AHEAD = 16
"""Nodes between the one worked on and the one whose slopes are fetched into the first cache: the
processor foresees by itself what will be read, but not what will be written only."""


@jit()
def _activator(x: Any, y: Any, pull_x: Any, pull_y: Any, numbers: Any) -> Any:
    rate, _, same, cross = numbers
    pull = fma(cross, pull_y, same * pull_x)
    return fma(x, fma(x * x, -THIRD, 1.0), pull - y) * rate


@jit()
def _inhibitor(x: Any, pull_x: Any, pull_y: Any, numbers: Any) -> Any:
    _, b, same, cross = numbers
    return fma(same, pull_y, fma(-1.0 * cross, pull_x, x + b))


@jit()
def _keep(zero: Any, i: Any, total_y: Any, context: Any) -> None:
    _, slopes, n, _, _ = context
    store(slopes, n + i, total_y)


@jit()
def _node(zero: Any, i: Any, total_x: Any, context: Any) -> None:
    state, slopes, n, width, numbers = context
    fetch(zero, slopes, i + AHEAD)
    fetch(zero, slopes, n + i + AHEAD)
    x, y = load(zero, state, i), load(zero, state, n + i)
    pull_x = fma(-width, x, total_x)
    pull_y = fma(-width, y, load(zero, slopes, n + i))
    store(slopes, i, _activator(x, y, pull_x, pull_y, numbers))
    store(slopes, n + i, _inhibitor(x, pull_x, pull_y, numbers))


@jit()
def _across(zero: Any, state: Any, slopes: Any, params: Any, ints: Any) -> None:
    # Node by node, in all lanes together; the sums of y wait in the place of y's slopes.
    n, half = ints[0], ints[1]
    numbers = (
        load(zero, params, 0),
        load(zero, params, 1),
        load(zero, params, 2),
        load(zero, params, 3),
    )
    context = (state, slopes, n, 2.0 * half + 1.0, numbers)
    total_x = first_across(zero, state, 0, n, half)
    total_y = first_across(zero, state, n, n, half)
    for i in range(0, n - LANES + 1, LANES):
        total_y = stride_across(zero, state, n, n, half, total_y, i, _keep, context)
        total_x = stride_across(zero, state, 0, n, half, total_x, i, _node, context)
    rest_across(zero, state, n, n, half, total_y, _keep, context)
    rest_across(zero, state, 0, n, half, total_x, _node, context)


@jit()
def _along(state: Any, slopes: Any, params: Any, ints: Any) -> None:
    # One trajectory, eight nodes at a time.
    n, half = ints[0], ints[1]
    numbers = (params[0, 0], params[1, 0], params[2, 0], params[3, 0])
    width = 2.0 * half + 1.0
    before_x, before_y = first_along(state, 0, n, half), first_along(state, n, n, half)
    for i in range(0, n, LANES):
        change_x = changes_along(state, 0, n, half, i)
        change_y = changes_along(state, n, n, half, i)
        left = n - i
        x = load_at(state, i) if left >= LANES else load_some(state, i, 0, left)
        y = load_at(state, n + i) if left >= LANES else load_some(state, n + i, 0, left)
        pull_x = fma(-width, x, before_x + change_x)
        pull_y = fma(-width, y, before_y + change_y)
        slope_x = _activator(x, y, pull_x, pull_y, numbers)
        slope_y = _inhibitor(x, pull_x, pull_y, numbers)
        if left >= LANES:
            store_at(slopes, i, slope_x)
            store_at(slopes, n + i, slope_y)
        else:
            store_some(slopes, i, slope_x, left)
            store_some(slopes, n + i, slope_y, left)
        before_x, before_y = before_x + last_of(change_x), before_y + last_of(change_y)


def networked_rhs(y, dy, lane_params, int_params):  # type: ignore[no-untyped-def]
    """Right-hand side; ``lane_params`` rows: 1/epsilon, b, sigma/2P times cos and sin of phi."""
    if y.shape[1] == LANES:
        _across(splat(0.0), y, dy, lane_params, int_params)
    elif int_params[0] >= LANES:
        _along(y, dy, lane_params, int_params)
    else:
        _across(0.0, y, dy, lane_params, int_params)


@cache
def _compiled() -> Any:
    return jit(RIGHT_HAND_SIDE)(networked_rhs)


@dataclass(frozen=True)
class NetworkedFHN:
    r"""A ring of FitzHugh-Nagumo oscillators coupled through both variables (eq. eq:FHNnet).

    .. math::
        \epsilon \dot x_i &= x_i - x_i^3/3 - y_i + \frac{\sigma}{2P} \sum_{j=i-P}^{i+P}
            [b_{xx} (x_j - x_i) + b_{xy} (y_j - y_i)] \\
        \dot y_i &= x_i + b + \frac{\sigma}{2P} \sum_{j=i-P}^{i+P}
            [b_{yx} (x_j - x_i) + b_{yy} (y_j - y_i)]

    with :math:`b_{xx} = b_{yy} = \cos\phi` and :math:`b_{xy} = -b_{yx} = \sin\phi`. The cost of a
    step does not depend on P. Parameters default to those of the paper's appendix sec:compS.

    Raises
    ------
    BadInput
        Unless 1 <= P, 2 P < n_nodes and epsilon > 0.
    """

    n_nodes: int = 500
    half_degree: int = 165
    sigma: float = 0.1
    epsilon: float = 0.05
    b: float = 0.5
    phi: float = math.pi / 2 - 0.1

    name = "networked_fhn"

    def __post_init__(self) -> None:
        """Check the ring and the time scale."""
        if self.half_degree < 1 or 2 * self.half_degree >= self.n_nodes:
            raise BadInput(
                f"P = {self.half_degree} on a ring of {self.n_nodes} nodes: "
                "1 <= P and 2 P < n_nodes are needed"
            )
        if not self.epsilon > 0.0:
            raise BadInput(f"epsilon = {self.epsilon}: must be above 0")

    @property
    def n_rows(self) -> int:
        """Number of integrated variables, 2 N0."""
        return 2 * self.n_nodes

    @property
    def n_second(self) -> int:
        """Number of second variables y in an initial state."""
        return self.n_nodes

    @property
    def lane_group(self) -> tuple[Any, ...]:
        """What trajectories must share to run as lanes of one kernel call."""
        return (self.name, self.n_nodes, self.half_degree)

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        return _compiled()

    @property
    def int_params(self) -> NDArray[np.int64]:
        """Integers that all lanes share: N0, P."""
        return np.array([self.n_nodes, self.half_degree], dtype=np.int64)

    @property
    def lane_params(self) -> Array:
        """This trajectory's column of parameters, shape (4,)."""
        gain = self.sigma / (2 * self.half_degree)
        same, cross = gain * math.cos(self.phi), gain * math.sin(self.phi)
        return np.array([1.0 / self.epsilon, self.b, same, cross])

    def state(self, u: Array, v: Array) -> Array:
        """Integrated variables of a state given by x and y, both (N0,)."""
        return np.concatenate([u, v])

    def node_pair(self, rows: Array) -> tuple[Array, Array]:
        """The two signals x and y from rows (n_rows, ...)."""
        return rows[: self.n_nodes], rows[self.n_nodes :]

    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array:
        """The variables y, shape (T, N0), from rows (n_rows, T)."""
        return rows[self.n_nodes :].T

    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]:
        """State (x, y) that initial conditions are drawn around; only the origin is known."""
        if which != "origin":
            raise BadInput(f'integrator.centre = "{which}": networked_fhn knows "origin" only')
        return 0.0, 0.0
