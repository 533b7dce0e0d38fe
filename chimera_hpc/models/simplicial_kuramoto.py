"""Phases on the nodes, links or triangles of a simplicial complex: higher-order Kuramoto."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.models.csr import Packed, packed
from chimera_hpc.models.frequencies import frequencies_of, frequency_parameters
from chimera_hpc.models.network_model import PhaseModel
from chimera_hpc.models.parameters import NETWORK_SIZE, ModelParameters, Parameter
from chimera_hpc.models.protocol import BuiltIn, Row
from chimera_hpc.network.complex import SIGNALS
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SimplicialKuramoto(PhaseModel):
    r"""Phases theta on the simplices of dimension k = ``order``.

    .. math::
        \dot\theta = \omega - K B_k^\top \sin(B_k \theta)
            - K B_{k+1} \sin(B_{k+1}^\top \theta)

    with the sine of each element. For k = 0 this is the Kuramoto model on the graph. With
    ``explosive``, each projection is coupled by the order parameter of the other:

    .. math::
        \dot\theta = \omega - K R_+ B_k^\top \sin(B_k \theta)
            - K R_- B_{k+1} \sin(B_{k+1}^\top \theta), \qquad
        R_\pm = \frac{1}{N_{k \pm 1}} \Big| \sum_j e^{i \theta^\pm_j} \Big|

    with :math:`\theta^- = B_k \theta` and :math:`\theta^+ = B_{k+1}^\top \theta`. See A. P. Millan,
    J. J. Torres, G. Bianconi, Phys. Rev. Lett. 124, 218301 (2020),
    https://doi.org/10.1103/PhysRevLett.124.218301. The explosive variant is that of the code that
    Bianconi published with it, https://github.com/ginestrab/Topological-and-Dirac-Synchronization:
    R_+ of the higher simplices multiplies the term of the lower ones, and the other way round.

    Parameters
    ----------
    network : Network
        Undirected, without weights.
    order : {0, 1, 2}
        k: phases on nodes, links or triangles.
    coupling : float
        K.
    omega : float or shape (N_k,)
        Natural frequencies, in radians per unit of time: `natural_frequencies` draws them.
    explosive : bool
        Whether the order parameters enter; both neighbouring dimensions need simplices then.

    Raises
    ------
    BadInput
        Another order, a network without such simplices, directed or with weights, numbers that are
        not finite, or another number of frequencies than simplices.
    """

    order: int = 1
    coupling: float = 1.0
    omega: float | ArrayLike = 0.0
    explosive: bool = False

    name = "simplicial_kuramoto"

    def __post_init__(self) -> None:
        """Check the network and the numbers."""
        if type(self.order) is not int or not 0 <= self.order <= 2:
            raise BadInput(f"order = {self.order!r}: allowed are 0 (nodes), 1 (links), 2")
        if self.network.weights is not None:
            raise BadInput(
                "simplicial_kuramoto knows no weights: use network.with_weights(None), or "
                "kuramoto_sakaguchi for phases on the nodes of a weighted network"
            )
        if self.n_nodes == 0:
            raise BadInput(f"order = {self.order}: the network has no {SIGNALS[self.order]}")
        sides = self.order > 0 and self.packed.integers[0] and self._n_upper > 0
        if self.explosive and not sides:
            raise BadInput(
                f"explosive needs simplices of the dimensions {self.order - 1} and "
                f"{self.order + 1} in the network: with_triangles adds triangles"
            )
        super().__post_init__()

    @property
    def n_nodes(self) -> int:
        """Number of phases N_k."""
        return self.network.size(SIGNALS[self.order])

    @property
    def _n_projected(self) -> int:
        return int(self.network.dirac(self.order).shape[1])

    @property
    def _n_upper(self) -> int:
        return self.network.size(SIGNALS[self.order + 1]) if self.order < 2 else 0

    @property
    def packed(self) -> Packed:
        """D = [B_k^T, B_(k+1)] and its transpose, as the kernel gets them."""
        return packed(self.network, "dirac", self.order)

    @property
    def lane_group(self) -> tuple[Any, ...]:
        """Key that trajectories must share to run as lanes of one kernel call."""
        return (self.name, self.explosive, self.packed.key)

    @property
    def formula(self) -> str:
        """Name of the right-hand side in `phase_kernels`."""
        return "explosive" if self.explosive else self.name

    @cached_property
    def lane_params(self) -> Array:
        """This trajectory's column: K, omega, and work space."""
        omega = self._each("omega", self.omega)
        return np.concatenate([[self.coupling], omega, np.zeros(4 + self._n_projected)])


def _on_network(network: Network, sweep: Any, row: Row) -> SimplicialKuramoto:
    order = SIGNALS.index(getattr(sweep.network, "signals", "nodes"))
    omega = frequencies_of(row, SimplicialKuramoto.name, network.size(SIGNALS[order]))
    return SimplicialKuramoto(network, order, row["coupling"], omega, bool(row["explosive"]))


PARAMETERS = ModelParameters(
    n_nodes=NETWORK_SIZE,
    parameters=(
        Parameter("coupling", float, 1.0, "Strength K of the coupling."),
        *frequency_parameters(0.0),
        Parameter("explosive", int, 0, "1: each side by the other's order parameter.", 0, 1),
    ),
)

MODEL = BuiltIn(PARAMETERS, on_network=_on_network, signals=SIGNALS)
