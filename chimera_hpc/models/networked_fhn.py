"""The classical networked FitzHugh-Nagumo model on a ring (paper eq. (F1))."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.models.network_model import NodeModel
from chimera_hpc.models.networked_fhn_network import on_network
from chimera_hpc.models.parameters import (
    EPSILON,
    HALF_DEGREE,
    RING_LIMIT,
    ModelParameters,
    Parameter,
    ring_size,
)
from chimera_hpc.models.protocol import BuiltIn, Row

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NetworkedFHN(NodeModel):
    r"""A ring of FitzHugh-Nagumo oscillators coupled through both variables (eq. (F1)).

    .. math::
        \epsilon \dot x_i &= x_i - x_i^3/3 - y_i + \frac{\sigma}{2P} \sum_{j=i-P}^{i+P}
            [b_{xx} (x_j - x_i) + b_{xy} (y_j - y_i)] \\
        \dot y_i &= x_i + b + \frac{\sigma}{2P} \sum_{j=i-P}^{i+P}
            [b_{yx} (x_j - x_i) + b_{yy} (y_j - y_i)]

    with :math:`b_{xx} = b_{yy} = \cos\phi` and :math:`b_{xy} = -b_{yx} = \sin\phi`. The cost of a
    step does not depend on P. Parameters default to those of the paper's app. F.

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
    def lane_group(self) -> tuple[Any, ...]:
        """Key that trajectories must share to run as lanes of one kernel call."""
        return (self.name, self.n_nodes, self.half_degree)

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        from chimera_hpc.models.networked_fhn_kernels import compiled

        return compiled()

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


def _build(sweep: Any, row: Row) -> NetworkedFHN:
    return NetworkedFHN(
        sweep.n_nodes, int(row["P"]), row["sigma"], row["epsilon"], row["b"], row["phi"]
    )


PARAMETERS = ModelParameters(
    n_nodes=ring_size(500),
    parameters=(
        Parameter("P", int, 165, HALF_DEGREE, low=1, high=10**7),
        EPSILON,
        Parameter("b", float, 0.5, "Excitability."),
        Parameter("phi", float, math.pi / 2 - 0.1, "Angle of the coupling matrix."),
        Parameter("sigma", float, 0.1, "Strength of the coupling."),
    ),
    limits=(RING_LIMIT,),
    constants={"orientation": 1},
)

MODEL = BuiltIn(PARAMETERS, _build, on_network)
