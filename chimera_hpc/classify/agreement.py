"""Agreement between methods: classes by SI, confusion matrices, Cohen's kappa, Rand index."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.classify.naming import CLASSES, NO_WINDOW, STEADY
from chimera_hpc.classify.tree import Integers

Verdicts = Sequence[str | None]
_COMMON = {*CLASSES, STEADY, NO_WINDOW, None}


def classes_by_incoherence(strength: ArrayLike) -> list[str]:
    """Name runs by their strength of incoherence: 0 ordered, 1 disordered, between chimera.

    Gopal, Chandrasekar, Venkatesan, Lakshmanan 2014, doi:10.1103/PhysRevE.89.052914.
    """
    ordered, chimera, disordered = CLASSES
    return [
        ordered if s <= 0.0 else disordered if s >= 1.0 else chimera
        for s in np.asarray(strength, dtype=np.float64).tolist()
    ]


def comparable(methods: Mapping[str, Verdicts]) -> dict[str, Verdicts]:
    """Return the methods without classes of their own: A of one is not to be compared with others.

    Their classes are ordered, chimera and disordered, beside runs at rest and without windows.
    """
    return {name: verdicts for name, verdicts in methods.items() if not {*verdicts} - _COMMON}


@dataclass(frozen=True)
class Confusion:
    """Confusion matrix of two methods: rows are classes of the first, columns of the second."""

    classes: tuple[str, ...]
    counts: Integers
    """(k, k): number of runs."""

    @property
    def agreement(self) -> float:
        """Share of runs on the diagonal; NaN without runs."""
        total = int(self.counts.sum())
        return float(np.trace(self.counts) / total) if total else float("nan")

    @property
    def kappa(self) -> float:
        """Cohen's kappa: agreement beyond chance, (p_o - p_e) / (1 - p_e); NaN if undefined."""
        total = int(self.counts.sum())
        if not total:
            return float("nan")
        by_chance = float(self.counts.sum(axis=0) @ self.counts.sum(axis=1)) / total**2
        return (self.agreement - by_chance) / (1.0 - by_chance) if by_chance < 1.0 else float("nan")


def confusion(
    first: Sequence[str | None], second: Sequence[str | None], classes: Sequence[str] = CLASSES
) -> Confusion:
    """Count pairs of classes of the same runs. Runs with a class outside `classes` are left out."""
    position = {name: i for i, name in enumerate(classes)}
    counts = np.zeros((len(classes), len(classes)), dtype=np.int64)
    for one, other in zip(first, second, strict=True):
        if one in position and other in position:
            counts[position[one], position[other]] += 1
    return Confusion(tuple(classes), counts)


def adjusted_rand(first: Sequence[str | None], second: Sequence[str | None]) -> float:
    """Adjusted Rand index of two methods: 1 for equal partitions, 0 as by chance.

    Names do not matter, only which runs are together. Runs without a class (None) by either method
    are left out; NaN without any. Hubert, Arabie 1985, doi:10.1007/BF01908075.
    """
    both = [pair for pair in zip(first, second, strict=True) if None not in pair]
    if not both:
        return float("nan")
    return rand_index(
        *(np.unique(side, return_inverse=True)[1] for side in zip(*both, strict=True))
    )


def rand_index(first: Integers, second: Integers) -> float:
    """Adjusted Rand index of two lists of labels (n,), integers from 0."""
    counts = np.zeros((first.max() + 1, second.max() + 1))
    np.add.at(counts, (first, second), 1.0)
    together, rows, columns, all_pairs = (
        float((x * (x - 1.0)).sum())
        for x in (counts, counts.sum(axis=1), counts.sum(axis=0), counts.sum())
    )
    by_chance = rows * columns / max(all_pairs, 1.0)
    most = 0.5 * (rows + columns)
    return (together - by_chance) / (most - by_chance) if most != by_chance else 1.0
