"""What models of oscillators on the nodes of any network have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.models.csr import Packed, Which, packed
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]


class NodeModel:
    """Oscillators on nodes, with ``n_variables`` variables each: first variables, then others."""

    name: ClassVar[str]
    n_variables: ClassVar[int] = 2

    if TYPE_CHECKING:  # a field or a property of subclasses

        @property
        def n_nodes(self) -> int: ...

    @property
    def n_rows(self) -> int:
        """Number of integrated variables."""
        return self.n_variables * self.n_nodes

    @property
    def n_second(self) -> int:
        """Number of variables other than the first of each oscillator."""
        return self.n_rows - self.n_nodes

    def state(self, u: Array, v: Array) -> Array:
        """Integrated variables of a state: first variable (N,), others."""
        return np.concatenate([u, v])

    def node_pair(self, rows: Array) -> tuple[Array, Array]:
        """The two variables of the oscillators from rows (n_rows, ...)."""
        return rows[: self.n_nodes], rows[self.n_nodes :]

    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array:
        """The variables other than the first, shape (T, n_second), from rows (n_rows, T)."""
        return rows[self.n_nodes :].T

    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]:
        """Centre of the ball of initial states; "origin" is the only one."""
        if which != "origin":
            raise BadInput(f'integrator.centre = "{which}": {self.name} knows "origin" only')
        return 0.0, 0.0


@dataclass(frozen=True, eq=False)
class NetworkModel(NodeModel):
    """A `NodeModel` whose nodes are coupled by one matrix of a network.

    Subclasses have what else `protocol.Model` lists, and more checks of their numbers.
    """

    network: Network

    which: ClassVar[Which] = "differences"
    """The matrix of the network that the kernel gets."""

    def __post_init__(self) -> None:
        """Check that numbers are finite; omega may be one number or one per node."""
        for name in (field.name for field in fields(self) if field.name != "network"):
            value = getattr(self, name)
            if name == "omega":
                self._each(name, value)
            elif not math.isfinite(value):
                raise BadInput(f"{name} = {value}: a finite number is needed")

    @property
    def n_nodes(self) -> int:
        """Number of oscillators."""
        return self.network.n_nodes

    @property
    def packed(self) -> Packed:
        """The matrix as the kernel gets it."""
        return packed(self.network, self.which)

    @property
    def kernel(self) -> str:
        """How the coupling is computed, in words."""
        return self.packed.kernel

    @property
    def int_params(self) -> NDArray[np.int64]:
        """Integers that all lanes share: the matrix."""
        return self.packed.integers

    @property
    def lane_group(self) -> tuple[Any, ...]:
        """Key that trajectories must share to run as lanes of one kernel call."""
        return (self.name, self.packed.key)

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        from chimera_hpc.models.planar_kernels import compiled

        return compiled(self.name)

    def _each(self, name: str, values: float | ArrayLike) -> Array:
        """Return one number per oscillator, given as one for all or as a vector."""
        found = np.asarray(values, dtype=np.float64)
        if found.shape not in ((), (self.n_nodes,)):
            raise BadInput(f"{name} has shape {found.shape}: needed is () or ({self.n_nodes},)")
        if not np.isfinite(found).all():
            raise BadInput(f"{name} holds values that are not finite")
        return np.broadcast_to(found, (self.n_nodes,))


class PhaseModel(NetworkModel):
    """A `NetworkModel` whose only variable is a phase; u = cos(phase), w = sin(phase)."""

    n_variables = 1

    @property
    def right_hand_side(self) -> Any:
        """Compiled right-hand side ``rhs(y, dy, lane_params, int_params)``."""
        from chimera_hpc.models.phase_kernels import compiled

        return compiled(self.formula)

    @property
    def formula(self) -> str:
        """Name of the right-hand side in `phase_kernels`."""
        return self.name

    def node_pair(self, rows: Array) -> tuple[Array, Array]:
        """Cosine and sine of the phases (n_rows, ...)."""
        return np.cos(rows), np.sin(rows)
