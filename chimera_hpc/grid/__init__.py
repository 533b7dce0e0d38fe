"""Job file -> `Sweep` -> `Points` -> blocks. Light: imports no kernel, no Zarr, no Dask."""

from chimera_hpc.grid.blocks import block_size, blocks
from chimera_hpc.grid.points import Points
from chimera_hpc.grid.spec import Sweep

__all__ = ["Points", "Sweep", "block_size", "blocks"]
