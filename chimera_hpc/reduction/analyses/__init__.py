"""What a job asks to be made of its points beside the classes: named functions, each one entry.

For developers: an analysis is a function that takes a `Given` and returns what results.json is to
hold of it under ``curves``; one line in `ANALYSES`, its name in `grid.selection`, and where no
existing figure fits, one in `chimera_hpc.plot.catalogue`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.reduction.analyses.given import Given

__all__ = ["ANALYSES", "Given", "analyse"]

Analysis = Callable[[Given], dict[str, Any]]


def _in(module: str, name: str) -> Analysis:
    # Loaded when it is asked for: some need compiled kernels, which take half a second to load.
    def made(given: Given) -> dict[str, Any]:
        analysis: Analysis = getattr(import_module(f"{__name__}.{module}"), name)
        return analysis(given)

    return made


ANALYSES: dict[str, Analysis] = {
    "networks": _in("ring", "networks"),
    "stability": _in("ring", "stability"),
    "basin": _in("ring", "basin"),
    "oscillation": _in("ring", "oscillation"),
    "variations": _in("method", "variations"),
    "atlas": _in("judged", "atlas"),
    "robustness": _in("judged", "robustness"),
    "incoherence": _in("incoherence", "incoherence"),
    "sigma-l": _in("incoherence", "sigma_l"),
    "agreement": _in("incoherence", "agreement"),
    "synthetic": _in("method", "synthetic"),
    "spectrum": _in("method", "spectrum"),
}
_NEED_ATLAS = ("atlas", "robustness")
_NEED_RUNS = ("sigma-l", "agreement", "incoherence", "variations", "spectrum")


def analyse(given: Given, say: Callable[[str], None]) -> dict[str, Any]:
    """Make the analyses that the job asks for; one that can't be made is said, not raised."""
    made = {}
    for name in given.sweep.reduction.analyses:
        reason = _obstacle(name, given)
        if not reason:
            try:
                made[name] = ANALYSES[name](given)
                continue
            except BadInput as error:
                reason = str(error)
        say(f"analysis {name}: {reason}")
    return made


def _obstacle(name: str, given: Given) -> str:
    if name in _NEED_ATLAS and not given.atlases:
        return "no atlas: reduction.atlas names a sweep that has been reduced"
    if name in _NEED_RUNS and given.has_result.sum() < 2:
        return "too few runs yet"
    if name == "agreement" and not given.sweep.reduction.deltas:
        return "reduction.deltas is needed"
    if name == "spectrum" and not given.sweep.reduction.show:
        return "reduction.show names no run"
    return ""
