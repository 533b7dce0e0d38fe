"""Chimera states in rings of topological FitzHugh-Nagumo oscillators.

The public names are loaded when they are first used (PEP 562), so that ``import chimera_hpc`` costs
milliseconds: the kernels compile, and scikit-learn alone takes seconds.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from chimera_hpc.features import fourier_features
    from chimera_hpc.models.networked_fhn import NetworkedFHN
    from chimera_hpc.reduce.variation import total_variations
    from chimera_hpc.simulate import simulate
    from chimera_hpc.store import open_sweep as open
    from chimera_hpc.topology import Topology

__version__ = "0.1.0"

__all__ = [
    "NetworkedFHN",
    "Topology",
    "__version__",
    "fourier_features",
    "open",
    "simulate",
    "total_variations",
]

# public name -> the module that has it, and its name there
_EXPORTS = {
    "NetworkedFHN": ("chimera_hpc.models.networked_fhn", "NetworkedFHN"),
    "Topology": ("chimera_hpc.topology", "Topology"),
    "fourier_features": ("chimera_hpc.features", "fourier_features"),
    "open": ("chimera_hpc.store", "open_sweep"),
    "simulate": ("chimera_hpc.simulate", "simulate"),
    "total_variations": ("chimera_hpc.reduce.variation", "total_variations"),
}


class _Package(ModuleType):
    """Keeps `simulate` the function: importing the module of that name would replace it."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in _EXPORTS and isinstance(value, ModuleType):
            value = getattr(value, _EXPORTS[name][1])
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _EXPORTS[name]
    value: object = getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
