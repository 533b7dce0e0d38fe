"""What a measure is: from one measured run to numbers with labels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from chimera_hpc.measures.fourier import FourierFeatures


class MeasuredRun(NamedTuple):
    """One run on the analysis interval."""

    t: NDArray[np.float64]
    """(T,)"""
    u: NDArray[np.float64]
    """(T, N), as it is stored"""
    w: NDArray[np.float64]
    """(T, N)"""
    features: FourierFeatures
    settings: Any
    """The job's table [features]: `job.tables.Features`."""
    distance: float
    """Of the last state from the centre of the ball of initial states, in the ball's norm."""


@dataclass(frozen=True)
class Measure:
    """Numbers of one run. Its module loads no kernels: labels are known without them."""

    labels: Callable[[Any], Sequence[str]]
    """Names of the numbers, for a table [features] of a job."""
    compute: Callable[[MeasuredRun], Sequence[float] | NDArray[np.float64]]
    """The numbers, as many as labels; NaN where one is not defined."""
