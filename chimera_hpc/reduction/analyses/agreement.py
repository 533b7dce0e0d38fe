"""Measures side by side: each turned into classes by its own rule, and how far they agree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.agreement import (
    adjusted_rand,
    classes_by_incoherence,
    comparable,
    confusion,
)
from chimera_hpc.classify.density import density_classes
from chimera_hpc.classify.naming import CLASSES, STEADY
from chimera_hpc.classify.verdicts import RULES
from chimera_hpc.job.class_names import is_papers_system
from chimera_hpc.reduction.analyses.incoherence import strengths, unit_of
from chimera_hpc.reduction.analyses.judged import most_frequent
from chimera_hpc.reduction.analysis_input import AnalysisInput

Verdicts = list[str | None]


def agreement(given: AnalysisInput) -> dict[str, Any]:
    """Classes of all measures that have a rule, on the same runs and cells, and how they agree.

    Triplets, SI (first of ``reduction.deltas``), sigma_1, and those of `classify.verdicts.RULES`
    whose numbers the store has. Steady runs count as ordered, except by SI and sigma_1, which have
    values for them. ``pairs`` has the confusion matrix of the runs, Cohen's kappa over runs and
    over cells, and the adjusted Rand index of the runs; ``differing`` lists the cells whose modal
    classes are not all equal. Where triplets and sigma_1 have names of their own
    (`reduction.names`), kappa is not defined for them, and cells are compared without them; the
    adjusted Rand index needs no names.
    """
    given.need_runs()
    methods, rules = _methods(given)
    modal = {name: _modal(given, verdicts) for name, verdicts in methods.items()}
    names = list(methods)
    return {
        "delta": given.sweep.reduction.deltas[0],
        "classes": CLASSES,
        "rules": rules,
        "remark": _of_rest(given, methods["SI"]),
        # A measure that is added comes with its pairs at the end.
        "pairs": [
            _pair(methods, modal, row, column)
            for i, column in enumerate(names)
            for row in names[:i]
        ],
        "modal": modal,
        "cells": [given.place(i) for i in range(given.n_cells)],
        "differing": [
            given.place(i) | {name: verdicts[i] for name, verdicts in modal.items()}
            for i in range(given.n_cells)
            if len({verdicts[i] for verdicts in comparable(modal).values()}) > 1
        ],
    }


def _methods(given: AnalysisInput) -> tuple[dict[str, Verdicts], dict[str, str]]:
    """Return the class of each run, None where it has no result, and the rule, by measure."""
    if not given.sweep.reduction.deltas:
        raise BadInput("reduction.deltas is needed")
    spec = given.sweep.reduction
    strength = strengths(given.local_sigma(), unit_of(given, spec.delta_unit), spec.deltas[0])
    sigma = np.where(given.has_result, given.scalar("sigma_1"), np.nan)
    density = density_classes(sigma, names=given.density_names)
    methods: dict[str, Verdicts] = {
        "triplets": [
            "ordered" if n == STEADY and is_papers_system(given.sweep) else n
            for n in given.own_names()
        ],
        "SI": list(classes_by_incoherence(np.nan_to_num(strength))),
        "sigma_1": [density.names[k] if k >= 0 else None for k in density.labels],
    }
    rules = {
        "triplets": f"{len(given.cut.names)} clusters of the total variations",
        "SI": f"0 ordered, 1 disordered, else chimera; delta {spec.deltas[0]:g}, {spec.delta_unit}",
        "sigma_1": "modes of its density",
    }
    for rule in RULES:
        if rule.quantity in given.scalars:
            values = np.where(given.status == Status.STEADY, 1.0, given.scalars[rule.quantity])
            methods[rule.quantity] = rule.classes(values)
            rules[rule.quantity] = rule.text
    for verdicts in methods.values():
        for run in np.flatnonzero(~given.has_result):
            verdicts[run] = None
    return methods, rules


def _of_rest(given: AnalysisInput, verdicts: Verdicts) -> str:
    """Return how many steady runs SI calls something else than ordered, in words; or ""."""
    steady = np.flatnonzero(given.status == Status.STEADY)
    count = sum(verdicts[run] != "ordered" for run in steady)
    if not count:
        return ""
    why = ": in what is left of a run at rest, delta is a share of a small range"
    said = f"SI does not call {count} of {len(steady)} steady runs ordered"
    return said + why * (given.sweep.reduction.delta_unit == "range")


def _pair(
    methods: dict[str, Verdicts], modal: dict[str, Verdicts], row: str, column: str
) -> dict[str, Any]:
    runs = confusion(methods[row], methods[column])
    cells = confusion(modal[row], modal[column])
    return {
        "rows": row,
        "columns": column,
        "counts": runs.counts,
        "agreement": runs.agreement,
        "kappa": runs.kappa,
        "adjusted_rand": adjusted_rand(methods[row], methods[column]),
        "cells_equal": int(np.trace(cells.counts)),
        "cells": int(cells.counts.sum()),
        "cells_kappa": cells.kappa,
    }


def _modal(given: AnalysisInput, verdicts: Sequence[str | None]) -> list[str | None]:
    return [
        most_frequent(Counter(verdicts[run] for run in given.runs(i))) for i in range(given.n_cells)
    ]
