"""The interface of a measure, which turns one run into labelled numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array, node_rows
from chimera_hpc.measures.neighbours import NeighbourTable, neighbours

if TYPE_CHECKING:
    from chimera_hpc.measures.fourier import NodeFeatures


class Orbits(NamedTuple):
    """Two components of N nodes (N, T), and their means in time (N,)."""

    x: Array
    y: Array
    x_mean: Array
    y_mean: Array


def orbits_of(u: ArrayLike, w: ArrayLike) -> Orbits:
    """Return the orbits of a run u, w (T, N)."""
    x, y = node_rows("u", u), node_rows("w", w)
    if x.shape != y.shape:
        raise BadInput(f"u and w must have one shape, not {x.T.shape} and {y.T.shape}")
    return Orbits(x, y, x.mean(axis=1), y.mean(axis=1))


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One run on the analysis interval. What several measures need is computed once."""

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

    @cached_property
    def orbits(self) -> Orbits:
        """(u, w) of each node, and its mean point."""
        return orbits_of(self.u, self.w)

    @cached_property
    def around(self) -> NeighbourTable:
        """Neighbours of each node."""
        return neighbours("ring" if self.pairs is None else self.pairs, self.u.shape[1])


@dataclass(frozen=True)
class Measure:
    """Numbers of one run. The module of a measure loads no kernels, so labels are cheap to read."""

    labels: Callable[[Any], Sequence[str]]
    """Return the names of the numbers, for a table [features] of a job."""
    compute: Callable[[MeasuredRun], Sequence[float] | NDArray[np.float64]]
    """Return one number per label; NaN where it is not defined."""
