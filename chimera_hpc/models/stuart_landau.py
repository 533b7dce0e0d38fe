"""Stuart-Landau oscillators on any network."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.models.frequencies import frequencies_of, frequency_parameters
from chimera_hpc.models.network_model import NetworkModel
from chimera_hpc.models.parameters import NETWORK_SIZE, ModelParameters, Parameter
from chimera_hpc.models.protocol import BuiltIn, Row
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StuartLandau(NetworkModel):
    r"""Limit-cycle oscillators z = x + i y near a Hopf bifurcation, coupled diffusively.

    .. math::
        \dot z_i = (\lambda + i \omega_i) z_i - (1 + i \gamma) |z_i|^2 z_i
            + K e^{-i \alpha} \sum_j A_{ij} (z_j - z_i)

    with A the weights of the links (1 without weights). The sum is not divided by the degree. The
    normal form is that of Y. Kuramoto, Chemical Oscillations, Waves, and Turbulence (Springer
    1984), chap. 2, https://doi.org/10.1007/978-3-642-69689-3. u is x and w is y.

    Parameters
    ----------
    network : Network
        Directed or not, with weights of any sign.
    coupling : float
        K.
    phase_lag : float
        alpha, in radians: 0 couples equal variables.
    growth : float
        lambda: without coupling, ``|z|`` tends to its square root if it is above 0.
    omega : float or shape (N,)
        Frequencies at z = 0, in radians per unit of time.
    shear : float
        gamma, by which the frequency falls with ``|z|^2``.

    Raises
    ------
    BadInput
        Numbers that are not finite, or another number of frequencies than nodes.
    """

    coupling: float = 1.0
    phase_lag: float = 0.0
    growth: float = 1.0
    omega: float | ArrayLike = 1.0
    shear: float = 0.0

    name = "stuart_landau"

    @cached_property
    def lane_params(self) -> Array:
        """This trajectory's column: four numbers, omega, and work space."""
        same = self.coupling * math.cos(self.phase_lag)
        cross = self.coupling * math.sin(self.phase_lag)
        work = np.zeros(2 * self.packed.n_shared)
        numbers = [self.growth, self.shear, same, cross]
        return np.concatenate([numbers, self._each("omega", self.omega), work])


def _on_network(network: Network, sweep: Any, row: Row) -> StuartLandau:
    omega = frequencies_of(row, StuartLandau.name, network.n_nodes)
    coupling, lag, growth = row["coupling"], row["phase_lag"], row["growth"]
    return StuartLandau(network, coupling, lag, growth, omega, row["shear"])


PARAMETERS = ModelParameters(
    n_nodes=NETWORK_SIZE,
    parameters=(
        Parameter("coupling", float, 1.0, "Strength K of the coupling, for each link."),
        Parameter("phase_lag", float, 0.0, "Phase lag alpha of the coupling (rad)."),
        Parameter("growth", float, 1.0, "Growth rate lambda at z = 0."),
        *frequency_parameters(1.0),
        Parameter("shear", float, 0.0, "Shear gamma: by how much |z|^2 lowers the frequency."),
    ),
)

MODEL = BuiltIn(PARAMETERS, on_network=_on_network)
