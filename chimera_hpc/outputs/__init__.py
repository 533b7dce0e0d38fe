"""From a store to what people read: classes, results.json, a table and figures.

The public names are loaded when first used: checking a job's selections must not load the store.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from chimera_hpc.outputs.reduction import Summary, reduce_sweep

__all__ = ["Summary", "reduce_sweep"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("chimera_hpc.outputs.reduction"), name)
