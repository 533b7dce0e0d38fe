"""The old place of `chimera_hpc.models.custom`; read until version 0.3, with a warning."""

import warnings

from chimera_hpc.models.custom import Limit, OwnModel, OwnPoint, Parameter

__all__ = ["Limit", "OwnModel", "OwnPoint", "Parameter"]

warnings.warn(
    "chimera_hpc.models.user is called chimera_hpc.models.custom since version 0.2; "
    "import OwnModel, Parameter and Limit from chimera_hpc",
    FutureWarning,
    stacklevel=2,
)
