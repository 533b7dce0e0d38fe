"""The interface of a measure, which turns one run into labelled numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from chimera_hpc.measures.fourier import NodeFeatures


class MeasuredRun(NamedTuple):
    """One run on the analysis interval."""

    t: NDArray[np.float64]
    """(T,)"""
    u: NDArray[np.float64]
    """(T, N), as stored"""
    w: NDArray[np.float64]
    """(T, N)"""
    features: NodeFeatures
    settings: Any
    """The job's table [features]: `job.tables.Features`."""
    distance: float
    """Distance of the last state from the centre of the ball of initial states, in its norm."""
    pairs: NDArray[np.int64] | None = None
    """(M, 2) pairs of nodes over which variations are taken; None: a node and the next."""


@dataclass(frozen=True)
class Measure:
    """Numbers of one run. The module of a measure loads no kernels, so labels are cheap to read."""

    labels: Callable[[Any], Sequence[str]]
    """Return the names of the numbers, for a table [features] of a job."""
    compute: Callable[[MeasuredRun], Sequence[float] | NDArray[np.float64]]
    """Return one number per label; NaN where it is not defined."""
