"""Job file -> `Sweep` -> `Points` -> blocks, and the registry of what a job may name."""

from chimera_hpc.job.blocks import block_size, blocks
from chimera_hpc.job.points import Points
from chimera_hpc.job.spec import Sweep

__all__ = ["Points", "Sweep", "block_size", "blocks"]
