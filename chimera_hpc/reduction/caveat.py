"""What has to be said of the names of classes where no one has checked them."""

from __future__ import annotations

from chimera_hpc.job import Sweep

_CHECKED = "topological_fhn"


def caveats(sweep: Sweep) -> list[str]:
    """Return a line if the rule of the paper's ring names classes of another model or network."""
    kind = "ring" if sweep.network is None else sweep.network.kind
    on_ring = kind == "ring"
    if (sweep.model == _CHECKED and on_ring) or sweep.reduction.names != "triplet":
        return []
    other = f"the model {sweep.model}" + ("" if on_ring else f" on {kind} networks")
    return [
        "class names (ordered, chimera, disordered) are those of the paper's ring and are not "
        f"checked for {other}: look at the space-time plots, or set reduction.names"
    ]
