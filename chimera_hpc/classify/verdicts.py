"""The class of a run by a single number of the panel, under the rule of the measure's source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.classify.naming import CLASSES

NEAR = 0.05
"""How near to 0 or 1 a number counts as 0 or 1, where a source says "close to"."""


@dataclass(frozen=True)
class Rule:
    """A number in [0, 1]: disordered up to `low`, ordered from `high` on, a chimera between."""

    quantity: str
    """Label of the number in a store."""
    low: float
    high: float
    source: str

    @property
    def text(self) -> str:
        """The rule in words."""
        return (
            f"{self.quantity} <= {self.low:g} disordered, >= {self.high:g} ordered, else chimera "
            f"({self.source})"
        )

    def classes(self, values: ArrayLike) -> list[str | None]:
        """Name runs by their numbers (n,); None for NaN."""
        ordered, chimera, disordered = CLASSES
        return [
            None
            if np.isnan(x)
            else disordered
            if x <= self.low
            else ordered
            if x >= self.high
            else chimera
            for x in np.asarray(values, dtype=np.float64).tolist()
        ]


RULES = (
    Rule("g0", NEAR, 1.0 - NEAR, "g0 0, between, 1: Kemeth et al. 2016; the limits are ours"),
    Rule("g0_global", NEAR, 1.0 - NEAR, "as g0, over all pairs"),
    Rule("plateau", 0.1, 1.0, "an arc next to a plateau: Omelchenko et al. 2013; 0.1 is ours"),
    Rule(
        "acm", NEAR, 1.0 - NEAR, "R^2 0, between, 1: Dogonasheva et al. 2021; the limits are ours"
    ),
)
"""Rules of measures whose sources have one. R, chi, lambda, h0 and centres of mass have none."""
