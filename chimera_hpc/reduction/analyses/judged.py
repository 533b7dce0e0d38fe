"""Analyses of runs that get the classes of another sweep."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify import tree
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.naming import CLASSES, NO_WINDOW, STEADY
from chimera_hpc.classify.robustness import fraction_curve
from chimera_hpc.job.networks import NETWORK_SEED, kind_parameters
from chimera_hpc.reduction.analysis_input import AnalysisInput
from chimera_hpc.reduction.cells import FreeAxis, describe, free_axes

_OWN = "own classes"
_NO_CURVES = {"seed", NETWORK_SEED.name}
"""Axes over whose values a share is taken."""
_FIRST, _LAST = CLASSES, (STEADY, NO_WINDOW)


def atlas(given: AnalysisInput) -> dict[str, Any]:
    """Every run judged by each atlas; the first one's classes as a background.

    For each cell: votes, modal class (over all runs with a result; ties go to the earlier of
    ordered, chimera, disordered), the mean triplet of the runs of the modal class, and their mean
    distance to the nearest training point.
    """
    first = given.need_atlas()
    judges = {name: _judged_cells(given, judge) for name, judge in given.atlases.items()}
    span = first.scaler[1] - first.scaler[0]
    background = {
        "triplets": first.points * np.where(span > 0.0, span, 1.0) + first.scaler[0],
        "labels": first.labels,
        "names": first.names,
    }
    return {"judges": judges, "background": background}


def _judged_cells(given: AnalysisInput, judge: Atlas) -> list[dict[str, Any]]:
    names, distance = given.judged_names(judge), judge.classify(given.triplets).distance
    found = []
    for i in range(given.n_cells):
        runs = given.runs(i)
        votes = Counter(names[run] for run in runs)
        modal = most_frequent(votes)
        chosen = [run for run in runs if names[run] == modal]
        oscillates = bool(chosen) and bool(np.isfinite(given.triplets[chosen]).all())
        found.append(
            {
                **given.place(i),
                "class": modal,
                "votes": {name: votes[name] for name in _in_order(votes)},
                "triplet": given.triplets[chosen].mean(axis=0) if oscillates else None,
                "distance": float(distance[chosen].mean()) if oscillates else None,
            }
        )
    return found


def most_frequent(votes: Counter[Any]) -> str | None:
    """Return the class with most votes, the earlier in the fixed order at a tie."""
    return max(_in_order(votes), key=lambda name: votes[name], default=None)


def _in_order(votes: Counter[Any]) -> list[str]:
    """Return the classes that have votes: the paper's, others by name, then steady, no window."""
    others = sorted(name for name in votes if name and name not in (*_FIRST, *_LAST))
    return [name for name in (*_FIRST, *others, *_LAST) if votes[name]]


def robustness(given: AnalysisInput) -> dict[str, Any]:
    """W: share of chimeras by each atlas against the number of reversed links (fig. 19).

    With [network], W against a parameter of the network, see `along_network`.
    """
    if given.sweep.network is not None:
        return along_network(given)
    given.need_atlas()
    row = given.points.row(0)
    return {
        "judge": next(iter(given.atlases)),
        "orientation": row["orientation"],
        "Q": row["Q"],
        "label": _label(given),
        "by": _curves(given, "flips", np.ones(len(given.cell), dtype=np.bool_), "chimera"),
    }


def along_network(given: AnalysisInput) -> dict[str, Any]:
    """W against the parameter of the network that has most values, for each value of other axes.

    The judges are the atlases, or the sweep's own classes where there are none. If none of these is
    called chimera, there is a curve for each class.
    """
    table = given.sweep.network
    assert table is not None
    known = {p.name for p in kind_parameters(table.kind, given.sweep.origin)} - {NETWORK_SEED.name}
    values = {n: len(np.unique(given.cells[n])) for n in given.points.axes if n in known}
    axis = max(values, key=lambda name: values[name], default=None)
    if axis is None or values[axis] < 2:
        raise BadInput(f'no parameter of the network "{table.kind}" varies')
    others = free_axes(given.cells, [n for n in given.points.axes if n not in _NO_CURVES | {axis}])
    keys = np.stack([np.zeros(given.n_cells), *(each.values for each in others)])
    _, first, group = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    named = _classes(given)
    curves = [
        {
            "label": _place_and_class(describe(place, others, math=True), name, named),
            "plain": _place_and_class(describe(place, others), name, named),
            "class": name,
            "by": _curves(given, axis, group.ravel()[given.cell] == number, name),
        }
        for number, place in enumerate(map(given.place, first.tolist()))
        for name in named
    ]
    symbol = FreeAxis((axis,), given.cells[axis]).symbol
    judge = next(iter(given.atlases), _OWN)
    return {"judge": judge, "axis": axis, "symbol": symbol, "curves": curves}


def _judges(given: AnalysisInput) -> dict[str, list[str | None]]:
    """Return the class of each run by each atlas, or by the sweep's own classes without one."""
    judges = {name: given.judged_names(judge) for name, judge in given.atlases.items()}
    return judges or {_OWN: given.own_names()}


def _classes(given: AnalysisInput) -> list[str]:
    """Return the classes that have a curve: chimera, or all if none is called so."""
    found = {str(name) for names in _judges(given).values() for name in names if name}
    known = found.union(*(atlas.names for atlas in given.atlases.values()))
    if any(_is([name], "chimera")[0] for name in known):
        return ["chimera"]
    return sorted(found - {STEADY, NO_WINDOW})


def _place_and_class(place: str, name: str, named: Sequence[str]) -> str:
    parts = [place, name if len(named) > 1 or not place else ""]
    return ", ".join(filter(None, parts))


def _curves(
    given: AnalysisInput, axis: str, among: NDArray[np.bool_], wanted: str
) -> dict[str, dict[str, Any]]:
    """Return the share of a class of some runs (n,) against a parameter, by each judge."""
    x, counted = given.points.columns[axis][among], given.has_result[among]
    curves = {}
    for name, verdicts in _judges(given).items():
        curve = fraction_curve(x, _is(verdicts, wanted)[among], counted)
        others = {
            other: fraction_curve(x, _is(verdicts, other)[among], counted).fraction
            for other in (("ordered", "disordered", STEADY) if wanted == "chimera" else (STEADY,))
        }
        curves[name] = {
            **curve.to_dict(),
            "others": others,
            "holds_until": curve.holds_until(),
            "half_at": _falls_below(curve.x, curve.fraction, 0.5),
            "zero_from": _zero_from(curve.x, curve.fraction),
        }
    return curves


def _label(given: AnalysisInput) -> str:
    row = given.points.row(0)
    label = f"orientation {row['orientation']}"
    if row["flip_set"] == 1:
        return f"{label}, links at node 1"
    return label if row["orientation"] == 2 or row["Q"] else f"{label}, $Q$ = 0"


def _is(verdicts: Sequence[str | None], name: str) -> NDArray[np.bool_]:
    """Tell which verdicts are a class or one of its sub-classes."""
    parts = [str(verdict).rpartition("-") for verdict in verdicts]
    return np.array([name in ("".join(p), p[0] if p[2].isdigit() else "") for p in parts])


def _falls_below(x: tree.Floats, fraction: tree.Floats, level: float) -> float | None:
    """Smallest x after which a running mean over five values stays below the level."""
    smooth = np.convolve(np.pad(fraction, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    high = np.flatnonzero(smooth >= level)
    if not len(high):
        return float(x[0])
    return float(x[high[-1] + 1]) if high[-1] + 1 < len(x) else None


def _zero_from(x: tree.Floats, fraction: tree.Floats) -> float | None:
    """Smallest x from which on the fraction is 0 throughout, if any."""
    positive = np.flatnonzero(fraction > 0.0)
    first = int(positive[-1]) + 1 if len(positive) else 0
    return float(x[first]) if first < len(x) else None
