"""Series in the order that a network gives its nodes, links or triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chimera_hpc.network.layout import community_bounds, picture_order
from chimera_hpc.network.network import Network
from chimera_hpc.plot.raster import Array, NodeSeries

_MOST_SAMPLES = 25_000_000
"""Samples that are held at once to be put in order: 200 MB of them."""
_MOST_BOUNDS = 12


@dataclass(frozen=True, eq=False)
class OrderedRows:
    """u with its rows in the order of a network; a `NodeSeries`."""

    values: Array
    """(N, T)"""
    bounds: tuple[int, ...] = ()
    """Rows at which another community begins, where these are few."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(N, T)"""
        return self.values.shape

    def __getitem__(self, nodes: slice, /) -> Array:
        """Return u of some rows."""
        return self.values[nodes]


def in_order(u: NodeSeries, network: Network | None, signals: str = "nodes") -> NodeSeries:
    """Return u (N, T) with rows by community; as it is without a network, or where it is large."""
    if network is None or np.prod(u.shape, dtype=np.float64) > _MOST_SAMPLES:
        return u
    order = picture_order(network, signals)
    bounds = community_bounds(network, order) if signals == "nodes" else np.empty(0, np.int64)
    if order is None and not len(bounds):
        return u
    values = u[0 : u.shape[0]]
    few = tuple(bounds.tolist()) if len(bounds) < _MOST_BOUNDS else ()
    return OrderedRows(values if order is None else values[order], few)
