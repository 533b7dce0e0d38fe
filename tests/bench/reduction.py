"""Clustering at scale: time of a tree, and what sampling costs in labels."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import classify

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Size:
    """One size of the problem."""

    points: int
    leaves: int
    seconds: float
    agreement: float
    """Share of equal labels with the tree over all points; NaN where that is too large."""


def triplets(source: Array, n: int) -> Array:
    """Draw n triplets like those of a sweep: resampled, and moved by 2 % of their range."""
    rng = np.random.default_rng(0)
    drawn = source[rng.integers(len(source), size=n)]
    return np.abs(drawn + 0.02 * np.ptp(source, axis=0) * rng.normal(size=drawn.shape))


def sizes(source: Array, points: tuple[int, ...], leaves: tuple[int, ...]) -> list[Size]:
    """Classify as many triplets as asked for, over trees of several sizes; three classes."""
    found = []
    for n in points:
        drawn = triplets(source, n)
        status = np.full(n, int(Status.DONE))
        whole = None
        for largest in sorted({min(k, n) for k in leaves}, reverse=True):
            began = time.perf_counter()
            made = classify(drawn, status, cuts=(3,), largest_tree=largest)
            seconds = time.perf_counter() - began
            labels = made.cuts[3].labels
            if not made.sampled:
                whole = labels
            agreement = float("nan") if whole is None else float((labels == whole).mean())
            found.append(Size(n, len(made.members), seconds, agreement))
    return found
