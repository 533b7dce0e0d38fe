"""Parameters of a model that a job may set: names, defaults, bounds. Imports no kernel."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short

Column: TypeAlias = NDArray[np.int64 | np.float64]


@dataclass(frozen=True)
class Parameter:
    """One number that a job sets. It is required if `default` is None."""

    name: str
    kind: type[int] | type[float]
    default: int | float | None
    text: str
    low: float = -math.inf
    high: float = math.inf
    above: float = -math.inf
    """Exclusive lower bound."""

    @property
    def allowed(self) -> str:
        """The values that `check` accepts, in words."""
        kind = "an integer" if self.kind is int else "a finite number"
        low = f" from {self.low:g}" if self.low > -math.inf else ""
        low = low or (f" above {self.above:g}" if self.above > -math.inf else "")
        return kind + low + (f" up to {self.high:g}" if self.high < math.inf else "")

    def check(self, value: object) -> int | float:
        """Return the value as `kind` (an int is a float too). Raises BadInput if not allowed."""
        number = self._number(value)
        if number is None or not (self.low <= number <= self.high and number > self.above):
            raise BadInput(f"{short(value)} is not {self.allowed}")
        return number

    def _number(self, value: object) -> int | float | None:
        if type(value) is int and self.kind is int:
            return value
        if type(value) not in (int, float) or self.kind is int:
            return None
        try:
            number = float(value)  # type: ignore[arg-type]
        except OverflowError:
            return None
        return number if math.isfinite(number) else None


@dataclass(frozen=True)
class Limit:
    """A bound by other parameters: column `name` is at most `highest(columns, n_nodes)`."""

    name: str
    needs: tuple[str, ...]
    highest: Callable[[Mapping[str, Column], int], Column | int]
    text: str


@dataclass(frozen=True)
class ModelParameters:
    """What a sweep needs to know of a model before it loads a kernel."""

    n_nodes: Parameter
    parameters: tuple[Parameter, ...]
    limits: tuple[Limit, ...] = ()
    forms: tuple[str, ...] = ("reduced",)
    constants: Mapping[str, int] = field(default_factory=dict)
    """Columns that are fixed by the model but that random streams and results need."""

    def find(self, name: str) -> Parameter | None:
        """Return the parameter of this name, or None."""
        return next((p for p in self.parameters if p.name == name), None)


HALF_DEGREE = "Links of a node to each side (half its degree); 2 P must be smaller than n_nodes."
RING_LIMIT = Limit("P", (), lambda _, n: (n - 1) // 2, "2 P must be smaller than n_nodes")
NETWORK_SIZE = Parameter("n_nodes", int, 50, "Nodes of the network.", low=1, high=10**7)
EPSILON = Parameter("epsilon", float, 0.05, "Ratio of the two time scales.", above=0)


def ring_size(default: int) -> Parameter:
    """Return the parameter ``n_nodes`` of a ring."""
    return Parameter("n_nodes", int, default, "Nodes of the ring, N0.", low=3, high=10**7)
