"""The store of a sweep, in Zarr v3. Nothing outside this package imports Zarr."""

from chimera_hpc.claims import ClaimLost
from chimera_hpc.store.blocks import Damage, DamagedChunk
from chimera_hpc.store.labelled import open_sweep
from chimera_hpc.store.reduction import Reduction
from chimera_hpc.store.store import Store
from chimera_hpc.store.write import Receipt

__all__ = [
    "ClaimLost",
    "Damage",
    "DamagedChunk",
    "Receipt",
    "Reduction",
    "Store",
    "open_sweep",
]
