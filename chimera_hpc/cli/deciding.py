"""How far a sweep with [decide] is, for `status`, `watch` and `plan`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from chimera_hpc.job import Sweep


def decide_state(path: Path, metadata: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the rounds, cells and runs of a store; None for a job without [decide].

    Also None while the results cannot be read, for the run will say so.
    """
    if "decide" not in metadata["attributes"]["spec"]:
        return None
    from chimera_hpc.base.errors import BadInput
    from chimera_hpc.run.rounds import standing
    from chimera_hpc.store.blocks import DamagedChunk
    from chimera_hpc.store.store import Store

    try:
        store = Store.open(path)
        now = standing(store)
    except (BadInput, DamagedChunk, OSError):
        return None
    if now is None:
        return None
    return {
        "rounds": len(store.sweeps),
        "cells": len(now.runs),
        "decided": int(now.found.decided.sum()),
        "undecided": int((~now.found.decided & (now.runs >= now.decide.most)).sum()),
        "runs": store.n_points,
        "full_grid": now.decide.full_grid(store.sweep.axes, now.n_grid),
        "expected_runs": store.n_points + now.expected_runs(),
    }


def state_line(state: Mapping[str, Any]) -> str:
    """Return the state in words."""
    undecided = state["undecided"]
    given_up = f", {undecided} undecided with the most runs" if undecided else ""
    return (
        f"  round {state['rounds']}: {state['decided']} of {state['cells']} cells decided"
        f"{given_up}; {state['runs']} runs of the {state['full_grid']} of a full grid"
    )


def plan_line(sweep: Sweep, store: Path) -> str:
    """Return the fewest, expected and most runs of a sweep with [decide].

    The expectation needs the votes of a first round; cells that a refinement adds are not in it.
    """
    decide = sweep.decide
    assert decide is not None
    from chimera_hpc.job.decide import is_single
    from chimera_hpc.run.rounds import grid_cells

    n_cells = grid_cells(sweep)
    best, worst = n_cells * decide.first, decide.full_grid(sweep.axes, n_cells)
    expected = "unknown before the first round"
    if store.is_dir():
        from chimera_hpc.store.ledger import read_metadata

        state = decide_state(store, read_metadata(store))
        if state is not None:
            expected = f"about {state['expected_runs']:.0f}"
            best = max(best, state["runs"])
            if decide.refine:
                expected += ", and those of cells that refinement adds"
    text = f"decide      at best {best} runs, expected {expected}, at worst {worst}"
    for name in decide.refine:
        if is_single(sweep.axes[name]):
            text += (
                f"\nwarning: decide.refine.{name}: {name} has one value, so no boundary along it"
            )
    return text
