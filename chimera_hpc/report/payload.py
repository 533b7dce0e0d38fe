"""The numbers behind the page's script: plain values, as small as they can be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Cut, has_triplet
from chimera_hpc.reduction.quality import poor_classes
from chimera_hpc.report.content import Content
from chimera_hpc.report.looks import looks_of
from chimera_hpc.report.pictures import Plates, palette, rounded
from chimera_hpc.report.tree_top import TreeTop

MOST_CELLS = 10_000
MOST_POINTS = 6_000
"""Cells on the map and runs in the projections; beyond them, evenly spread ones are shown."""


@dataclass(frozen=True)
class Shown:
    """What of a sweep the page shows."""

    cells: NDArray[np.int64]
    """Numbers of the cells on the map."""
    points: NDArray[np.int64]
    """Clustered runs in the projections."""

    @classmethod
    def of(cls, content: Content) -> Shown:
        """Choose them."""
        runs = np.flatnonzero(has_triplet(content.triplets, content.status))
        return cls(thinned(np.arange(content.n_cells), MOST_CELLS), thinned(runs, MOST_POINTS))


def thinned(values: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return at most so many values, at equal distances."""
    if len(values) <= most:
        return values
    return values[np.linspace(0, len(values) - 1, most).round().astype(np.int64)]


def exact(values: NDArray[Any]) -> list[int] | list[str]:
    """Return integers for the page's script: as texts where one is beyond a double's 53 bits."""
    numbers: list[int] = values.tolist()
    large = max(map(abs, numbers), default=0) > 2**53
    return [str(value) for value in numbers] if large else numbers


def axis_labels(content: Content) -> list[tuple[str, list[str]]]:
    """Return name and labels of the rising values of each free axis; a single one at least."""
    named = [(axis.plain, [axis.label(v) for v in np.unique(axis.values)]) for axis in content.axes]
    return named or [("all runs", ["1"])]


def payload(content: Content, shown: Shown, plates: Plates, top: TreeTop) -> dict[str, Any]:
    """Return what the page's script reads; see its file for the use."""
    row_of = np.full(content.n_cells, -1, dtype=np.int64)
    row_of[shown.cells] = np.arange(len(shown.cells))
    return {
        "first": str(content.first_cut),
        "axes": [{"name": name, "values": labels} for name, labels in axis_labels(content)],
        "cells": _cells(content, shown),
        "points": {
            "row": row_of[content.cell[shown.points]].tolist(),
            "seed": exact(content.store.points.columns["seed"][shown.points]),
            **{
                name: [rounded(v) for v in content.triplets[shown.points, k].tolist()]
                for k, name in enumerate(("V_theta", "V_a", "V_Omega"))
            },
        },
        "cuts": {name: _cut(content, shown, top, cut) for name, cut in content.named_cuts.items()},
        "open": _open(content, shown),
        "tree": {"xs": top.xs, "ys": top.ys, "ends": top.ends, "sizes": top.sizes},
        "plates": {str(row_of[i]): plate for i, plate in plates.by_cell.items() if row_of[i] >= 0},
        "networks": list(plates.networks),
        "palettes": {name: _colours(name) for name in ("viridis", "twilight") if plates.networks},
    }


def _colours(name: str) -> list[str]:
    return ["#" + bytes(colour).hex() for colour in palette(name)]


def _cells(content: Content, shown: Shown) -> dict[str, Any]:
    results = content.count(*(code for code in Status if code.is_result))
    oscillating = content.count(Status.DONE)
    failed = content.count(*(code for code in Status if code.is_failure))
    total = np.bincount(content.cell, minlength=content.n_cells)
    place = [np.unique(axis.values, return_inverse=True)[1] for axis in content.axes]
    return {
        "name": [content.cell_name(i) or "all runs" for i in shown.cells.tolist()],
        "place": [p[shown.cells].tolist() for p in place] or [[0] * len(shown.cells)],
        "total": total[shown.cells].tolist(),
        "results": results[shown.cells].tolist(),
        "oscillating": oscillating[shown.cells].tolist(),
        "failed": failed[shown.cells].tolist(),
    }


def _open(content: Content, shown: Shown) -> list[bool]:
    """Return which of the cells shown are not decided; empty without a judge."""
    now = content.standing
    return [] if now is None else (~now.found.decided[shown.cells]).tolist()


def _cut(content: Content, shown: Shown, top: TreeTop, cut: Cut) -> dict[str, Any]:
    counted = content.votes(cut)
    members = content.classification.members
    return {
        "looks": looks_of(counted.names, poor_classes(cut, content.r_squared)),
        "sizes": np.bincount(cut.labels[cut.labels >= 0], minlength=len(cut.names)).tolist(),
        "depth": rounded(cut.depth, 6),
        "modal": counted.modal[shown.cells].tolist(),
        "votes": counted.votes[shown.cells].tolist(),
        "labels": cut.labels[shown.points].tolist(),
        "leaves": cut.labels[members[top.members]].tolist(),
    }
