"""The one registry: what a job may name, and where it is.

For developers: a model, a method, an analysis or a figure is one file and one line here,
``name: "module:object"``. Nothing is imported before it is asked for.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chimera_hpc.integrate.tableau import Tableau

MODELS = {
    "topological_fhn": "chimera_hpc.models.topological_fhn:MODEL",
    "networked_fhn": "chimera_hpc.models.networked_fhn:MODEL",
}
"""Objects with ``parameters`` and ``build``: `models.protocol.ModelKind`."""

METHODS = {
    "tsit5": "chimera_hpc.integrate.tsit5:TSIT5",
    "dopri5": "chimera_hpc.integrate.dopri5:DOPRI5",
    "verner6": "chimera_hpc.integrate.verner6:VERNER6",
    "kcl4": "chimera_hpc.integrate.kcl4:KCL4",
}
"""Runge-Kutta pairs: `integrate.tableau.Tableau`."""


@cache
def load(place: str) -> Any:
    """Return the object at ``module:object``."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def method(name: str) -> Tableau:
    """Return the Runge-Kutta pair of this name."""
    found: Tableau = load(METHODS[name])
    return found
