"""What the integrator, a block of work and a job need of a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.models.parameters import ModelParameters
from chimera_hpc.network.network import Network

Array: TypeAlias = NDArray[np.float64]
Row: TypeAlias = Mapping[str, int | float]
"""Parameters of one point by name, the seed among them."""


class Model(Protocol):
    """A model with its parameters, as the integrator and a block of work need it.

    ``right_hand_side`` is compiled with the signature `integrate.stepper.RIGHT_HAND_SIDE`, for
    arrays (rows, lanes). All lanes of a call share ``int_params``. ``lane_params`` is the column of
    one lane. The first ``n_nodes`` rows are the observed signal u.
    """

    @property
    def name(self) -> str: ...
    @property
    def n_nodes(self) -> int: ...
    @property
    def n_rows(self) -> int: ...
    @property
    def n_second(self) -> int: ...
    @property
    def lane_group(self) -> tuple[Any, ...]: ...
    @property
    def right_hand_side(self) -> Any: ...
    @property
    def int_params(self) -> NDArray[np.int64]: ...
    @property
    def lane_params(self) -> Array: ...
    def state(self, u: Array, v: Array) -> Array: ...
    def node_pair(self, rows: Array) -> tuple[Array, Array]: ...
    def second_variable(self, rows: Array, v0: Array, t: Array) -> Array: ...
    def equilibrium(self, which: Literal["origin", "upper", "lower"]) -> tuple[float, float]: ...


class ModelKind(Protocol):
    """A model without values of its parameters, as the registry or a job's ``model`` names it."""

    @property
    def parameters(self) -> ModelParameters: ...
    def build(self, sweep: Any, row: Row) -> Model: ...


@dataclass(frozen=True)
class BuiltIn:
    """A model of this package: its table of parameters, and the functions that build a point.

    ``on_network`` builds it on any network. The parameters of the network, and so of the ring that
    is the default, are then added to the table, unless the model has a P of its own: ``builder``
    then makes the points of a job without a table [network].
    """

    parameters: ModelParameters
    builder: Callable[[Any, Row], Model] | None = None
    on_network: Callable[[Network, Any, Row], Model] | None = None
    signals: tuple[str, ...] = ("nodes",)
    """Where u may live: "nodes", "links", "triangles"."""

    def build(self, sweep: Any, row: Row) -> Model:
        """Return the model of one point, from its row of columns."""
        assert self.builder is not None
        return self.builder(sweep, row)

    def build_on(self, network: Network, sweep: Any, row: Row) -> Model:
        """Return the model of one point on a network."""
        assert self.on_network is not None
        return self.on_network(network, sweep, row)
