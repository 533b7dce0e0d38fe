"""FitzHugh-Nagumo oscillators as topological signals on any network (paper eqs. (1), b)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
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
from chimera_hpc.network.complex import SIGNALS, dimension
from chimera_hpc.network.network import Network
from chimera_hpc.network.sweep_network import ring_of

if TYPE_CHECKING:
    from chimera_hpc.models.csr import Packed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TopologicalFHN:
    r"""Topological FitzHugh-Nagumo oscillators on the nodes, links or triangles of a network.

    u lives on the N_k simplices of dimension k, and linear signals v on those of dimensions k - 1
    and k + 1. The Dirac operator D = [B_k^T, B_{k+1}] couples them. The "full" form is

    .. math::
        \epsilon \dot u = u - u^3/3 - D v, \qquad \dot v = b + c v + D^\top u.

    On nodes (k = 0, D = B_1), v lives on the links, and these are the paper's equations (eqs.
    eq. (1), eq. (2)). u is affected only through w = D v, and the equation of v is linear.
    Multiplying it by D gives the exact reduced form

    .. math::
        \epsilon \dot u = u - u^3/3 - w, \qquad
        \dot w = b s + c w + L_k u, \qquad s = D 1, \quad L_k = D D^\top

    of 2 N_k variables, with the Hodge Laplacian L_k (for nodes the graph Laplacian). For nodes, the
    orientation enters only through the divergence s, and triangles not at all, because
    B_1 B_2 = 0. For k >= 1, turning a simplex of dimension k changes the sign of its u. Weights
    enter as in `Network.boundary`. Time is dimensionless, as in the paper.

    Parameters
    ----------
    topology : Network
        The oriented network. On a ring, L_0 u is a sliding sum, at a cost that does not depend on
        P. On others it is a sparse product.
    epsilon, b, c : float
        Time-scale separation, excitability, decay rate of the linear signals.
    form : {"reduced", "full"}
        Which of the two sets of equations is integrated.
    signals : {"nodes", "links", "triangles"}
        Where u lives.

    Raises
    ------
    BadInput
        Unless epsilon > 0; a directed network; a network without such signals.
    """

    topology: Network
    epsilon: float = 0.05
    b: float = 0.5
    c: float = -0.01
    form: Literal["reduced", "full"] = "reduced"
    signals: Literal["nodes", "links", "triangles"] = "nodes"

    name = "topological_fhn"

    def __post_init__(self) -> None:
        """Check the time scale and that there are signals."""
        if not self.epsilon > 0.0:
            raise BadInput(f"epsilon = {self.epsilon}: must be above 0")
        if self.topology.directed:
            raise BadInput(
                "topological_fhn: a directed network has no boundary matrices; "
                "read it as an undirected one, whose directions are orientations"
            )
        if self.topology.size(self.signals) == 0:
            raise BadInput(f'signals = "{self.signals}": the network has none')

    @property
    def order(self) -> int:
        """Dimension k of the simplices on which u lives."""
        return dimension(self.signals)

    @cached_property
    def reach(self) -> int:
        """P if L_0 u is computed as a sliding sum, on the nodes of a ring; 0 otherwise.

        In reduced form, a ring may be given by its links in any order.
        """
        if self.order > 0:
            return 0
        return self.topology.half_degree or (_reach(self.topology) if self.form == "reduced" else 0)

    @property
    def kernel(self) -> str:
        """How L_k u is computed, in words: the cheapest way that the network allows."""
        return "sliding sums" if self.reach else self._packed.kernel

    @property
    def n_nodes(self) -> int:
        """Number of oscillators N_k."""
        return self.topology.size(self.signals)

    @property
    def n_rows(self) -> int:
        """Number of integrated variables: 2 N_k, or N_k and all linear signals in full form."""
        return self.n_nodes + (self.n_nodes if self.form == "reduced" else self.n_second)

    @property
    def lane_group(self) -> tuple[Any, ...]:
        """Key that trajectories must share to run as lanes of one kernel call."""
        if self.reach:
            return (self.name, self.form, self.n_nodes, self.reach)
        return (self.name, self.form, self._packed.key)

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        if self.reach:
            from chimera_hpc.models.topological_fhn_kernels import compiled
        else:
            from chimera_hpc.models.simplicial_fhn_kernels import compiled
        return compiled(self.form)

    @property
    def _packed(self) -> Packed:
        from chimera_hpc.models.csr import packed

        return packed(self.topology, "laplacian" if self.form == "reduced" else "dirac", self.order)

    @property
    def int_params(self) -> NDArray[np.int64]:
        """Integers that all lanes share: N0, P of a ring; of others the matrices."""
        if self.reach:
            return np.array([self.n_nodes, self.reach], dtype=np.int64)
        return self._packed.integers

    @cached_property
    def lane_params(self) -> Array:
        """This trajectory's column of parameters, shape (n_params,)."""
        rate = 1.0 / self.epsilon
        if self.form == "full":
            signs = self.topology.link_signs if self.reach else np.empty(0)
            return np.concatenate([[rate, self.b, self.c], signs])
        work = np.zeros(0 if self.reach else self._packed.n_shared)
        source = self.topology.source(self.order)
        return np.concatenate([[rate, self.c], self.b * source, work])

    def state(self, u: Array, v: Array) -> Array:
        """Integrated variables of a state given by u (N_k,) and the linear signals (n_second,)."""
        return np.concatenate([u, self._gather(v) if self.form == "reduced" else v])

    def node_pair(self, rows: Array) -> tuple[Array, Array]:
        """The two signals that live on the same simplices, u and w = D v, from (n_rows, ...)."""
        u, second = rows[: self.n_nodes], rows[self.n_nodes :]
        return u, second if self.form == "reduced" else self._gather(second)

    def _gather(self, v: Array) -> Array:
        if self.order == 0:
            return self.topology.gather_links(v)
        gathered: Array = self.topology.dirac(self.order) @ v
        return gathered

    def links(self, w: Array, v0: Array, t: Array) -> Array:
        r"""Linear signals that belong to a reduced run: for nodes, those on the links.

        With :math:`\Pi = I - D^\top L_k^+ D`, the projection on the kernel of D (for nodes the
        cycle space),

        .. math::
            v(t) = D^\top L_k^+ w(t) - \tfrac{b}{c}\,\Pi 1 + e^{ct}\,\Pi (v(0) + \tfrac{b}{c} 1).

        Parameters
        ----------
        w : shape (T, N_k)
        v0 : shape (n_second,)
        t : shape (T,)

        Returns
        -------
        shape (T, n_second)
        """
        # Imported here, because the import takes 0.17 s and workers do not need it.
        from scipy.special import exprel

        solved = self.topology.solve_laplacian(w.T, self.order)
        if self.order == 0:
            image = self.topology.spread_to_links(solved)
        else:
            image = self.topology.dirac(self.order).T @ solved
        cycles_v0 = self.topology.cycle_part(v0, self.order)
        cycles_one = self.topology.cycle_part(np.ones(self.n_second), self.order)
        decay = np.exp(self.c * t)
        grown = t * exprel(self.c * t)
        drift = np.outer(cycles_v0, decay) + self.b * np.outer(cycles_one, grown)
        return np.asarray((image + drift).T)

    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array:
        """The linear signals, shape (T, n_second), from rows (n_rows, T) and the initial v0."""
        second = rows[self.n_nodes :].T
        return self.links(second, v0, t) if self.form == "reduced" else second

    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]:
        """Homogeneous state (u, v), the centre of the ball of initial states.

        "upper" and "lower" are the stable equilibria u = +-sqrt(3), v = -b/c of an orientation
        with zero divergence (paper sec. The model), for nodes only. "origin" is u = v = 0, as in
        the paper's simulations.
        """
        if which == "origin":
            return 0.0, 0.0
        if self.order > 0:
            raise BadInput(f'integrator.centre = "{which}": {self.signals} have "origin" only')
        return (3.0**0.5 if which == "upper" else -(3.0**0.5)), -self.b / self.c

    @property
    def n_second(self) -> int:
        """Number of linear signals: v- on (k - 1)-simplices, then v+ on (k + 1)-simplices."""
        return (
            self.topology.n_links if self.order == 0 else self.topology.dirac(self.order).shape[1]
        )


def _reach(network: Network) -> int:
    """Return P if the links join each node with the P next ones on either side, else 0."""
    n, half = network.n_nodes, network.n_links // network.n_nodes
    if network.weights is not None or network.n_links != n * half or 2 * half >= n:
        return 0
    ahead = (network.links[:, 1] - network.links[:, 0]) % n
    # No two links join the same nodes.
    return half if np.minimum(ahead, n - ahead).max(initial=0) <= half else 0


def _build(sweep: Any, row: Row) -> TopologicalFHN:
    return _on_network(ring_of(sweep, row), sweep, row)


def _on_network(network: Network, sweep: Any, row: Row) -> TopologicalFHN:
    signals: Any = getattr(sweep.network, "signals", "nodes")
    form = sweep.integrator.form
    return TopologicalFHN(network, row["epsilon"], row["b"], row["c"], form, signals)


PARAMETERS = ModelParameters(
    n_nodes=ring_size(50),
    parameters=(
        Parameter("P", int, None, HALF_DEGREE, low=1, high=10**7),
        Parameter("Q", int, None, "Links reversed at node 0, on each side.", low=0, high=10**7),
        Parameter("orientation", int, 1, "Rule that orients the ring's links.", low=1, high=2),
        EPSILON,
        Parameter("b", float, 0.5, "Excitability."),
        Parameter("c", float, -0.01, "Self-coupling of the links."),
        Parameter("flips", int, 0, "Links reversed at random, Q_r.", low=0, high=10**15),
        Parameter(
            "flip_set", int, 0, "Links to draw those from: 0 all, 1 node 0's.", low=0, high=1
        ),
    ),
    limits=(
        RING_LIMIT,
        Limit("Q", ("P",), lambda columns, _: columns["P"], "Q may not exceed P"),
        Limit(
            "flips",
            ("P", "flip_set"),
            lambda columns, n: np.where(columns["flip_set"] == 1, 2, n) * columns["P"],
            "flips may not exceed the number of links, n_nodes * P (2 P of them at node 0)",
        ),
    ),
    forms=("reduced", "full"),
)

MODEL = BuiltIn(PARAMETERS, _build, _on_network, SIGNALS)
