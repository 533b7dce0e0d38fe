"""FitzHugh-Nagumo oscillators as topological signals on a ring (paper eqs. eq:eq1a, eq:eq1b)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import stream_key, topology_stream
from chimera_hpc.models.parameters import (
    EPSILON,
    HALF_DEGREE,
    RING_LIMIT,
    Limit,
    ModelParameters,
    Parameter,
    ring_size,
)
from chimera_hpc.models.protocol import BuiltIn, Row
from chimera_hpc.network.topology import Topology

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TopologicalFHN:
    r"""One ring of topological FitzHugh-Nagumo oscillators with its parameters.

    The paper's equations (eqs. eq:eq1a, eq:eq1b), the node-link or "full" form, are

    .. math::
        \epsilon \dot u_i = u_i - u_i^3/3 - (B_1 v)_i, \qquad
        \dot v_j = b + c v_j + (B_1^\top u)_j

    with u on the N0 nodes and v on the N1 = N0 P links. The links affect the nodes only through
    w = B_1 v, and the link equation is linear. Multiplying it by B_1 gives the exact reduced form

    .. math::
        \epsilon \dot u = u - u^3/3 - w, \qquad
        \dot w = b s + c w + L_0 u, \qquad s = B_1 1, \quad L_0 = B_1 B_1^\top

    of 2 N0 variables. The orientation enters only through the divergence s. Time is dimensionless,
    as in the paper.

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
        """Key that trajectories must share to run as lanes of one kernel call."""
        return (self.name, self.form, self.n_nodes, self.topology.half_degree)

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        from chimera_hpc.models.topological_fhn_kernels import compiled

        return compiled(self.form)

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
        # Imported here, because the import takes 0.17 s and workers do not need it.
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
        """Homogeneous state (u, v), the centre of the ball of initial states.

        "upper" and "lower" are the stable equilibria u = +-sqrt(3), v = -b/c of an orientation
        with zero divergence (paper sec. The model). "origin" is u = v = 0, as in the paper's
        simulations.
        """
        if which == "origin":
            return 0.0, 0.0
        return (3.0**0.5 if which == "upper" else -(3.0**0.5)), -self.b / self.c

    @property
    def n_second(self) -> int:
        """Number of second variables v in an initial state."""
        return self.topology.n_links


def _build(sweep: Any, row: Row) -> TopologicalFHN:
    topology = Topology.ring(sweep.n_nodes, int(row["P"]), int(row["orientation"]))
    topology = topology.reorient_node(0, int(row["Q"]))
    flips = int(row["flips"])
    if flips:
        stream = topology_stream(*stream_key(sweep.model, sweep.n_nodes, row), flips)
        among = topology.links_at(0) if int(row["flip_set"]) == 1 else None
        topology = topology.reorient_random(flips, stream, among)
    return TopologicalFHN(topology, row["epsilon"], row["b"], row["c"], sweep.integrator.form)


PARAMETERS = ModelParameters(
    n_nodes=ring_size(50),
    parameters=(
        Parameter("P", int, None, HALF_DEGREE, low=1, high=10**7),
        Parameter("Q", int, None, "Links reoriented at node 1, on each side.", low=0, high=10**7),
        Parameter("orientation", int, 1, "Rule that orients the ring's links.", low=1, high=2),
        EPSILON,
        Parameter("b", float, 0.5, "Excitability."),
        Parameter("c", float, -0.01, "Self-coupling of the links."),
        Parameter("flips", int, 0, "Links reversed at random, Q_r.", low=0, high=10**15),
        Parameter(
            "flip_set", int, 0, "Links to draw those from: 0 all, 1 node 1's.", low=0, high=1
        ),
    ),
    limits=(
        RING_LIMIT,
        Limit("Q", ("P",), lambda columns, _: columns["P"], "Q may not exceed P"),
        Limit(
            "flips",
            ("P", "flip_set"),
            lambda columns, n: np.where(columns["flip_set"] == 1, 2, n) * columns["P"],
            "flips may not exceed the number of links, n_nodes * P (2 P of them at node 1)",
        ),
    ),
    forms=("reduced", "full"),
)

MODEL = BuiltIn(PARAMETERS, _build)
