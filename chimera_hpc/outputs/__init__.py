"""From a store to what people read: classes, results.json, a table and figures."""

from chimera_hpc.outputs.reduction import Summary, reduce_sweep

__all__ = ["Summary", "reduce_sweep"]
