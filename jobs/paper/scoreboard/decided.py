"""The rule of claims on cells that get seeds until their modal class is decided."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scoreboard.evidence import Evidence, base_of, select


def outcome_of(wrong: int, still_open: int, exceptions: int) -> bool | None:
    """Return whether a claim holds that allows for exceptions; None when open cells tip it."""
    if wrong > exceptions:
        return False
    return True if wrong + still_open <= exceptions else None


def decided_cells(
    evidence: Evidence, job: str, where: Mapping[str, Any], axis: str, is_class: str
) -> tuple[int, int, int, str]:
    """Return how many cells are, are not of a class, or are open, and a text on each that is not.

    Also on each that took more than the fewest runs. Steady runs count as ordered.
    """
    cells = select(evidence.value(job, "decide/cells"), where)
    fewest = min(cell["runs"] for cell in cells)
    right = wrong = still_open = 0
    told = []
    for cell in cells:
        name = "ordered" if cell["class"] == "steady" else base_of(cell["class"] or "none")
        right += cell["decided"] and name == is_class
        wrong += cell["decided"] and name != is_class
        still_open += not cell["decided"]
        if cell["runs"] > fewest or not cell["decided"] or name != is_class:
            state = "is" if cell["decided"] else "is not decided, most are"
            share = f"{cell['share']:.2f} of {cell['runs']} runs"
            told.append(f"{axis} = {cell[axis]:.3g} {state} {name} ({share})")
    return right, wrong, still_open, "; ".join(told)
