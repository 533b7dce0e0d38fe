"""The old place of `chimera_hpc.models.custom`; read until version 0.3, with a warning."""

import multiprocessing

from chimera_hpc.base.renaming import warn
from chimera_hpc.models.custom import Limit, OwnModel, OwnPoint, Parameter

__all__ = ["Limit", "OwnModel", "OwnPoint", "Parameter"]

# A worker process has a parent that has said it.
if multiprocessing.parent_process() is None:
    warn("chimera_hpc.models.user", "chimera_hpc (from chimera_hpc import OwnModel, ...)")
