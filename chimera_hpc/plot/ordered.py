"""Series in the order that a network gives its nodes, links or triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.network.layout import community_bounds, picture_order
from chimera_hpc.network.network import Network
from chimera_hpc.plot.raster import Array, NodeSeries

_MOST_SAMPLES = 25_000_000
"""Samples of the largest series that is put in order, which is held in memory as it is stored."""
_MOST_BOUNDS = 12


@runtime_checkable
class OnDisk(Protocol):
    """A `NodeSeries` of which single rows are dear."""

    def in_memory(self) -> NodeSeries:
        """Return it as it is stored, in memory."""


@dataclass(frozen=True, eq=False)
class OrderedRows:
    """u with its rows in the order of a network; a `NodeSeries`."""

    series: Any
    """(N, T), an array or what is indexed by one: the rows are read as they are asked for."""
    order: NDArray[np.int64] | None = None
    """Row of the series that comes at each place; None: as they are."""
    bounds: tuple[int, ...] = ()
    """Rows at which another community begins, where these are few."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(N, T)"""
        shape: tuple[int, ...] = self.series.shape
        return shape

    def __getitem__(self, nodes: slice, /) -> Array:
        """Return u of some rows."""
        rows: Array = self.series[nodes if self.order is None else self.order[nodes]]
        return rows


def in_order(u: NodeSeries, network: Network | None, signals: str = "nodes") -> NodeSeries:
    """Return u (N, T) with rows by community; as it is without a network, or where it is large."""
    if network is None or np.prod(u.shape, dtype=np.float64) > _MOST_SAMPLES:
        return u
    order = picture_order(network, signals)
    bounds = community_bounds(network, order) if signals == "nodes" else np.empty(0, np.int64)
    if order is None and not len(bounds):
        return u
    few = tuple(bounds.tolist()) if len(bounds) < _MOST_BOUNDS else ()
    return OrderedRows(u.in_memory() if isinstance(u, OnDisk) else u, order, few)
