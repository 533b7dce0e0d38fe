"""What has to be said of the names of classes where no one has checked them."""

from __future__ import annotations

from chimera_hpc.job import Sweep

_CHECKED = "topological_fhn"


def caveats(sweep: Sweep) -> list[str]:
    """Return a line if the rule of the paper's ring names the classes of another model."""
    if sweep.model == _CHECKED or sweep.reduction.names != "triplet":
        return []
    return [
        "class names (ordered, chimera, disordered) are those of the paper's ring and are not "
        f"checked for the model {sweep.model}: look at the space-time plots, or set reduction.names"
    ]
