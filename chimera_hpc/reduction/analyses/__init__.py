"""The analyses that a job asks for in addition to the classes; each makes one entry.

For developers: an analysis is a function in a file of this folder that takes an `AnalysisInput`
and returns what results.json is to hold of it under ``curves``; and one line in `job.registry`. It
raises BadInput when the sweep lacks what it needs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.registry import ANALYSES, load
from chimera_hpc.reduction.analysis_input import AnalysisInput


def analyse(given: AnalysisInput, say: Callable[[str], None]) -> dict[str, Any]:
    """Make the analyses that the job asks for; for one that cannot be made, call `say`."""
    made = {}
    for name in given.sweep.reduction.analyses:
        try:
            made[name] = load(ANALYSES[name])(given)
        except BadInput as error:
            say(f"analysis {name}: {error}")
    return made
