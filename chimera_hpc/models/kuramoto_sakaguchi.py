"""Kuramoto-Sakaguchi phase oscillators on any network."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.models.frequencies import frequencies_of, frequency_parameters
from chimera_hpc.models.network_model import PhaseModel
from chimera_hpc.models.parameters import NETWORK_SIZE, ModelParameters, Parameter
from chimera_hpc.models.protocol import BuiltIn, Row
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class KuramotoSakaguchi(PhaseModel):
    r"""Phase oscillators with a phase lag, coupled through the links of a network.

    .. math::
        \dot\theta_i = \omega_i + K \sum_j A_{ij} \sin(\theta_j - \theta_i - \alpha)

    with A the weights of the links (1 without weights; A_ij that of the link from j to i of a
    directed network). The sum is not divided by the degree. One sine and one cosine per oscillator
    are computed, however many links there are. On `Network.two_populations` (n, A) with K = 1 this
    is the model of D. M. Abrams, R. Mirollo, S. H. Strogatz, D. A. Wiley, Phys. Rev. Lett. 101,
    084103 (2008), https://doi.org/10.1103/PhysRevLett.101.084103, up to the self-coupling of each
    oscillator, which adds the same constant to all frequencies.

    Parameters
    ----------
    network : Network
        Directed or not, with weights of any sign.
    coupling : float
        K.
    phase_lag : float
        alpha, in radians.
    omega : float or shape (N,)
        Natural frequencies, in radians per unit of time: `natural_frequencies` draws them.

    Raises
    ------
    BadInput
        Numbers that are not finite, or another number of frequencies than nodes.
    """

    coupling: float = 1.0
    phase_lag: float = 0.0
    omega: float | ArrayLike = 0.0

    name = "kuramoto_sakaguchi"
    which = "adjacency"

    @cached_property
    def lane_params(self) -> Array:
        """This trajectory's column: K cos(alpha), K sin(alpha), omega, and work space."""
        pair = self.coupling * np.array([math.cos(self.phase_lag), math.sin(self.phase_lag)])
        work = np.zeros(2 * self.n_nodes + 2 * self.packed.n_shared)
        return np.concatenate([pair, self._each("omega", self.omega), work])


def _on_network(network: Network, sweep: Any, row: Row) -> KuramotoSakaguchi:
    omega = frequencies_of(row, KuramotoSakaguchi.name, network.n_nodes)
    return KuramotoSakaguchi(network, row["coupling"], row["phase_lag"], omega)


PARAMETERS = ModelParameters(
    n_nodes=NETWORK_SIZE,
    parameters=(
        Parameter("coupling", float, 1.0, "Strength K of the coupling, for each link."),
        Parameter("phase_lag", float, 0.0, "Phase lag alpha (rad)."),
        *frequency_parameters(0.0),
    ),
)

MODEL = BuiltIn(PARAMETERS, on_network=_on_network)
