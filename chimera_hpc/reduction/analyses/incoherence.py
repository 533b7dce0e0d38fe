"""Analyses of the differences of neighbours: SI, discontinuity measure, sigma_l."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.agreement import classes_by_incoherence
from chimera_hpc.classify.density import density_classes, stable_bandwidths
from chimera_hpc.classify.naming import CLASSES
from chimera_hpc.measures.incoherence import discontinuity_measure, strength_of_incoherence
from chimera_hpc.reduction.analyses.judged import most_frequent
from chimera_hpc.reduction.analysis_input import AnalysisInput

Array = NDArray[np.float64]
_CURVE = np.geomspace(1e-4, 1.0, 81)


def incoherence(given: AnalysisInput) -> dict[str, Any]:
    """SI and discontinuity measure for ``reduction.deltas``, and SI against delta as a curve.

    Under both units of delta: ``range``, a fraction of the range of u of each run, and
    ``absolute``. For each delta, a row per cell: median and mean SI, SI of every seed, mean
    discontinuity measure, share of runs with SI = 0, between, and 1, and the modal of these three
    classes. A run without a result is left out.
    """
    given.need_runs()
    spec = given.sweep.reduction
    return {
        "unit": spec.delta_unit,
        "groups": given.sweep.features.groups,
        "deltas": list(spec.deltas),
        "cells": [given.place(i) for i in range(given.n_cells)],
        **{unit: _by_unit(given, unit) for unit in ("range", "absolute")},
    }


def _by_unit(given: AnalysisInput, unit: str) -> dict[str, Any]:
    local, scale = given.local_sigma(), unit_of(given, unit)
    curve = np.stack([strengths(local, scale, delta) for delta in _CURVE], axis=1)
    return {
        "by_delta": [_at_delta(given, local, scale, d) for d in given.sweep.reduction.deltas],
        "curve": {
            "delta": _CURVE,
            "mean": [_mean(curve[given.runs(i)], 0) for i in range(given.n_cells)],
        },
    }


def unit_of(given: AnalysisInput, unit: str) -> Array:
    """What a delta is multiplied with for each run, shape (n,)."""
    return given.scalar("range_u") if unit == "range" else np.ones(len(given.status))


def strengths(local: Array, scale: Array, delta: float) -> Array:
    """Return SI for each run, shape (n,); NaN where `scale` is."""
    made: Array = np.full(len(local), np.nan)
    known = np.isfinite(scale)
    made[known] = strength_of_incoherence(local[known], delta * scale[known])
    return made


def _at_delta(given: AnalysisInput, local: Array, scale: Array, delta: float) -> dict[str, Any]:
    strength = strengths(local, scale, delta)
    known = np.isfinite(scale)
    jumps = np.full(len(local), np.nan)
    jumps[known] = discontinuity_measure(local[known], delta * scale[known])
    rows = []
    for i in range(given.n_cells):
        runs = given.runs(i)
        votes = Counter(classes_by_incoherence(strength[runs]))
        rows.append(
            {
                "median": float(np.median(strength[runs])) if len(runs) else None,
                "mean": float(_mean(strength[runs])),
                "runs": strength[runs],
                "discontinuity": float(_mean(jumps[runs])),
                "shares": {name: votes[name] / max(len(runs), 1) for name in CLASSES},
                "class": most_frequent(votes),
            }
        )
    return {"delta": delta, "rows": rows}


def _mean(values: Array, axis: int | None = None) -> Any:
    return values.mean(axis=axis) if len(values) else np.full(values.shape[1:], np.nan)


def sigma_l(given: AnalysisInput) -> dict[str, Any]:
    """Classes of sigma_1 by the modes of its kernel density (paper fig. 23).

    The number of classes is the density's own at Silverman's bandwidth; ``bandwidths_of_three`` is
    the interval of bandwidths with three modes.
    """
    given.need_runs()
    values = np.where(given.has_result, given.scalar("sigma_1"), np.nan)
    made = density_classes(values, names=given.density_names)
    rows = []
    for i in range(given.n_cells):
        labels = made.labels[given.runs(i)]
        votes = Counter(made.names[k] for k in labels if k >= 0)
        modal = max(votes, key=lambda name: (votes[name], -made.names.index(name)), default=None)
        rows.append({**given.place(i), "class": modal, "votes": dict(votes)})
    return {
        "n_classes": len(made.names),
        "names": made.names,
        "bandwidth": made.bandwidth,
        "bandwidths_of_three": stable_bandwidths(values, 3),
        "modes": made.modes,
        "cuts": made.cuts,
        "grid": made.grid,
        "density": made.density,
        "values": values,
        "cell_of_run": given.cell,
        "labels": made.labels,
        "cells": rows,
    }
