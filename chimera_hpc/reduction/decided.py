"""The results of a sweep with [decide]: decided cells, boundaries, agreement of the judge."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.boundaries import Boundary, boundaries
from chimera_hpc.classify.classification import Cut
from chimera_hpc.classify.crossing import crossing
from chimera_hpc.classify.modes import count_votes, modal_labels, vote_labels
from chimera_hpc.job import Sweep
from chimera_hpc.job.axes import Same
from chimera_hpc.models.parameters import Column
from chimera_hpc.reduction.cells import FreeAxis, decided_class, describe
from chimera_hpc.reduction.table import DECIDED
from chimera_hpc.run.rounds import Standing, judged
from chimera_hpc.store.store import Store

MOST_LINES = 20
"""Boundaries that are printed one by one."""


def judge_words(sweep: Sweep) -> str:
    """Return what gives the runs of a sweep with [decide] their classes."""
    other = sweep.decide is not None and sweep.decide.judge == "atlas"
    return f"atlas {sweep.reduction.atlas[0]}" if other else "tree of the first round"


def standing_by(
    store: Store,
    status: NDArray[np.int64],
    triplets: NDArray[np.float64],
    atlases: Mapping[str, Atlas],
) -> Standing | None:
    """Return how far the cells are decided; None without [decide], and without its judge.

    Under a convention other than the sweep's own, the votes follow that convention, for the runs
    that the sweep's own convention chose.
    """
    sweep, atlas = store.sweep, None
    if sweep.decide is None:
        return None
    if sweep.decide.judge == "atlas":
        atlas = atlases.get(sweep.reduction.atlas[0])
        if atlas is None:
            return None
    n_first = len(store.sweeps[0].points())
    return judged(sweep, store.points, triplets, status, n_first, atlas)


def decided_results(
    store: Store, now: Standing | None, cut: Cut, status: NDArray[np.int64]
) -> dict[str, Any]:
    """Return ``decide`` and ``boundaries`` of results.json; empty where nothing is decided.

    cut: that of the tree over all runs, with which the judge is compared.
    """
    if now is None:
        return {}
    found, names = now.found, now.names
    cells = [
        {name: now.cells[name][i].item() for name in now.axes}
        | {
            "class": names[found.leader[i]] if found.leader[i] >= 0 else None,
            "decided": bool(found.decided[i]),
            "runs": int(now.runs[i]),
            "share": float(found.share[i]),
            "interval": [float(found.low[i]), float(found.high[i])],
            "votes": {names[j]: int(now.votes[i, j]) for j in np.flatnonzero(now.votes[i])},
        }
        for i in range(len(now.runs))
    ]
    return {
        "decide": {
            "rounds": len(store.sweeps),
            "runs": store.n_points,
            "full_grid": now.decide.full_grid(store.sweep.axes, now.n_grid),
            "confidence": now.decide.confidence,
            "judge": judge_words(store.sweep),
            "agreement": _agreement(store, now, cut, status),
            "cells": cells,
        },
        "boundaries": [*_boundaries(now, store.sweep)],
    }


def _agreement(
    store: Store, now: Standing, cut: Cut, status: NDArray[np.int64]
) -> dict[str, float | None]:
    """Return the share of runs, and of decided cells, with the same class in the last tree."""
    frozen = np.array([*now.judge.names, ""])[now.labels]
    last = np.array([*cut.names, ""])[cut.labels]
    both = (now.labels >= 0) & (cut.labels >= 0)
    cell = store.points.cells()[0]
    votes = count_votes(cell, vote_labels(cut.labels, status, len(cut.names)), len(now.runs))
    modal = np.array([*cut.names, ""])[modal_labels(votes[:, : len(cut.names)], cut.sizes)]
    mine = np.array([*now.judge.names, "", "", ""])[now.found.leader]
    chosen = now.found.decided & (mine != "")
    return {
        "runs": float((frozen == last)[both].mean()) if both.any() else None,
        "cells": float((mine == modal)[chosen].mean()) if chosen.any() else None,
    }


def _boundaries(now: Standing, sweep: Sweep) -> Iterator[dict[str, Any]]:
    free = {name: now.cells[name] for name in now.independent}
    for axis in now.decide.refine:
        fixed = [name for name in now.axes if axis not in _roots(sweep, name)]
        for boundary in boundaries(free, now.classes, axis):
            low, high = boundary.ends
            interval = [free[axis][low].item(), free[axis][high].item()]
            yield {
                "axis": axis,
                **{name: now.cells[name][low].item() for name in fixed},
                "between": [now.names[now.classes[i]] for i in (low, high)],
                "at": sum(interval) / 2,
                "interval": interval,
                "crossing": _crossing(now, boundary, free[axis]),
            }


def _crossing(now: Standing, boundary: Boundary, values: Column) -> dict[str, Any] | None:
    """Return where the votes cross; None without undecided cells between the two decided ones."""
    cells = list(boundary.cells)
    if len(cells) == 2:
        return None
    below, above = (now.votes[cells, now.classes[end]] for end in boundary.ends)
    at, low, high = crossing(values[cells], below, above, now.decide.confidence)
    return {"at": at, "interval": [low, high]}


def _roots(sweep: Sweep, name: str) -> tuple[str, ...]:
    """Return an axis and those that it follows."""
    axis = sweep.axes.get(name)
    return (name, *_roots(sweep, axis.name)) if isinstance(axis, Same) else (name,)


def tables_of(results: Mapping[str, Any], cuts: Sequence[int]) -> dict[str, list[Any]]:
    """Return the cells of each cut, before them, as `DECIDED`, those with their decided classes."""
    tables = {str(k): results["cuts"][str(k)]["cells"] for k in cuts}
    if "decide" not in results:
        return tables
    both = zip(results["decide"]["cells"], tables[str(cuts[0])], strict=True)
    decided = [{**cell, "class": decided_class(d), "votes": d["votes"]} for d, cell in both]
    return {DECIDED: decided, **tables}


def decided_lines(results: Mapping[str, Any], axes: list[FreeAxis]) -> Iterator[str]:
    """Yield the lines of the terminal; none for a job without [decide]."""
    decide = results.get("decide")
    if decide is None:
        return
    cells = decide["cells"]
    count = Counter(cell["class"] for cell in cells if cell["decided"])
    of_each = ", ".join(f"{number} {name}" for name, number in count.most_common())
    yield (
        f"decided: {count.total()} of {len(cells)} cells at {100 * decide['confidence']:g} %"
        f"{of_each and f' ({of_each})'}, by "
        f"{decide['runs']} runs in {decide['rounds']} rounds; a full grid takes "
        f"{decide['full_grid']}"
    )
    shares = decide["agreement"]
    if shares["runs"] is not None:
        cells_too = "" if shares["cells"] is None else f", {shares['cells']:.1%} of decided cells"
        yield (
            f"judge: {decide.get('judge', 'not known')}; {shares['runs']:.1%} of the runs have its "
            f"class in the tree of all runs{cells_too}"
        )
    found = results["boundaries"]
    for boundary in found[:MOST_LINES]:
        yield boundary_line(boundary, axes)
    if len(found) > MOST_LINES:
        yield f"and {len(found) - MOST_LINES} more boundaries: results.json"


def boundary_line(boundary: Mapping[str, Any], axes: list[FreeAxis]) -> str:
    """Return a boundary in words: ``epsilon = 0.03 (0.029 to 0.031): ordered | chimera``."""
    rest = [
        FreeAxis(names, axis.values)
        for axis in axes
        if (names := tuple(name for name in axis.names if name in boundary))
    ]
    where = describe(boundary, rest)
    low, high = boundary["interval"]
    text = f"{boundary['axis']} = {boundary['at']:.6g} ({low:.6g} to {high:.6g})"
    if (cross := boundary["crossing"]) is not None:
        low, high = cross["interval"]
        text += f", votes cross at {cross['at']:.6g} ({low:.6g} to {high:.6g})"
    return f"{text}: {' | '.join(boundary['between'])}" + (f" at {where}" if where else "")
