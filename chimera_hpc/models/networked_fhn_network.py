"""The networked FitzHugh-Nagumo model on any network."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.models.network_model import NetworkModel
from chimera_hpc.models.protocol import Row
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NetworkFHN(NetworkModel):
    r"""FitzHugh-Nagumo oscillators coupled to the mean of their neighbours in both variables.

    .. math::
        \epsilon \dot x_i &= x_i - x_i^3/3 - y_i + \frac{\sigma}{d_i} \sum_j A_{ij}
            [b_{xx} (x_j - x_i) + b_{xy} (y_j - y_i)] \\
        \dot y_i &= x_i + b + \frac{\sigma}{d_i} \sum_j A_{ij}
            [b_{yx} (x_j - x_i) + b_{yy} (y_j - y_i)]

    with A the weights of the links (1 without weights), :math:`d_i = \sum_j A_{ij}`,
    :math:`b_{xx} = b_{yy} = \cos\phi` and :math:`b_{xy} = -b_{yx} = \sin\phi`. On a ring this is
    `NetworkedFHN` (eq. (F1)), which has a kernel of its own for rings. u is x and w is y.

    Parameters
    ----------
    network : Network
        Directed or not.
    sigma, epsilon, b, phi : float
        Strength of the coupling, ratio of the two time scales, excitability, angle of the coupling
        matrix in radians.

    Raises
    ------
    BadInput
        A node without links, epsilon that is not above 0, numbers that are not finite.
    """

    sigma: float = 0.1
    epsilon: float = 0.05
    b: float = 0.5
    phi: float = math.pi / 2 - 0.1

    name = "networked_fhn"
    which = "mean"

    def __post_init__(self) -> None:
        """Check the numbers, and that every node has a degree."""
        super().__post_init__()
        if not self.epsilon > 0.0:
            raise BadInput(f"epsilon = {self.epsilon}: must be above 0")
        _ = self.packed

    @cached_property
    def lane_params(self) -> Array:
        """This trajectory's column: four numbers and work space."""
        same, cross = self.sigma * math.cos(self.phi), self.sigma * math.sin(self.phi)
        work = np.zeros(2 * self.packed.n_shared)
        return np.concatenate([[1.0 / self.epsilon, self.b, same, cross], work])


def on_network(network: Network, sweep: Any, row: Row) -> NetworkFHN:
    """Return the model of one point on a network."""
    return NetworkFHN(network, row["sigma"], row["epsilon"], row["b"], row["phi"])
