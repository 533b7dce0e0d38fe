"""Old name of `chimera_hpc.models.custom`, kept until version 0.3, with a warning."""

import multiprocessing

from chimera_hpc.base.renaming import warn
from chimera_hpc.models.custom import Limit, OwnModel, OwnPoint, Parameter

__all__ = ["Limit", "OwnModel", "OwnPoint", "Parameter"]

# The parent of a worker process has already warned.
if multiprocessing.parent_process() is None:
    warn("chimera_hpc.models.user", "chimera_hpc (from chimera_hpc import OwnModel, ...)")
