"""The triplets of a sweep under the other conventions that its panel measures.

`[measures] panel` may name a convention, such as paper-printed. The same runs then have a second
triplet, which the task computes from the same series. Everything that follows from triplets is made
once more in a folder of that name inside the sweep's folder: results.json, figures, and the group
`reduction` with tree and atlas. The names of the other scalars do not change, so analyses and rules
read both alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.job import Sweep
from chimera_hpc.job.registry import measures
from chimera_hpc.measures.conventions import PRESETS
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.reduction import StoredReduction, read_reduction
from chimera_hpc.store.store import Store

Scalars = Mapping[str, NDArray[np.float64]]
OWN = ""
"""Stands for the sweep's own convention, its table [features]."""


def conventions(sweep: Sweep) -> tuple[str, ...]:
    """Return `OWN` and the names of the other conventions that the sweep measures."""
    return (OWN, *(name for name in sweep.measures.panel if name in PRESETS))


def seen_under(
    convention: str, sweep: Sweep, scalars: Scalars, status: NDArray[np.int64]
) -> tuple[Scalars, NDArray[np.int64]]:
    """Return scalars and status (n,) with V_theta, V_a, V_Omega and results of a convention."""
    if convention == OWN:
        return scalars, status
    *labels, code = measures([convention])[0].labels(sweep.features)
    triplet = {name: scalars[label] for name, label in zip(TRIPLET, labels, strict=True)}
    found = np.where(np.isfinite(scalars[code]), scalars[code], status).astype(np.int64)
    return {**scalars, **triplet}, found


def stored_reduction(folder: Path, convention: str = OWN) -> StoredReduction:
    """Return what the last reduction of a sweep's folder stored; BadInput if there is none."""
    if convention == OWN:
        return Store.open(folder / STORE_NAME).reduction()
    return read_reduction(folder / convention)
