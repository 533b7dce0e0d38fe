"""Series at the resolution of a picture, in time and along the ring.

If a period covers several dots of a picture, each dot shows one sample. Otherwise each dot shows
the range of u within it, because equally spaced samples would show false patterns (aliasing).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

ROWS, COLUMNS = 300, 600
"""Dots of a picture along the ring and along time."""
PERIODS = 12
"""Periods in a close-up."""
_MOST_STRIDE = 8
"""Largest step between the nodes of a close-up. Beyond it, a close-up shows a part of the ring."""
_SOME_NODES = 64
_FLAT = 1e-3
"""Range of a node, in units of the largest value, below which it does not oscillate."""
_JUMPS = 0.4
"""Largest share of dots with jumps in a readable picture: about five dots per period."""
_PIECE = 2_000_000
"""Number of samples that are processed at once."""
_GROUPS = 24
_SMOOTH = 0.25
"""Number of groups of neighbours that are compared, and the share of the whole range within which
neighbours are alike."""


class NodeSeries(Protocol):
    """u node by node: ``series[first:last]`` is an array (nodes, T); an array (N, T) is one."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(N, T)"""

    def __getitem__(self, nodes: slice, /) -> Array:
        """Return u of some nodes."""


@dataclass(frozen=True)
class Raster:
    """What a picture shows of a series: rows are nodes, columns are times."""

    values: Array
    """(rows, columns)"""
    times: tuple[float, float]
    """The outer edges of the first and the last column."""
    nodes: tuple[int, int]
    """First node and the one after the last."""
    is_whole: bool = True
    """Whether these are all nodes."""
    is_range: bool = False
    """Whether values are the range of u in a dot, instead of u."""
    stride: int = 1
    """Nodes from a row to the next."""
    length: str = ""
    """The part of the series that a close-up shows, in words."""

    @property
    def partly(self) -> str:
        """The nodes that are drawn, in words; empty if all are drawn."""
        if self.stride > 1:
            return f"one node in {self.stride}"
        return "" if self.is_whole else f"nodes {self.nodes[0]} to {self.nodes[1] - 1}"


def n_periods(u: NodeSeries) -> tuple[float, float]:
    """Return the number of periods of a slow and of a fast node, from crossings of the mid-level.

    These are the quantiles 0.1 and 0.75 over the nodes that oscillate; 0 if no node does.
    """
    rows = _some(u)
    low, high = np.fmin.reduce(rows, axis=1), np.fmax.reduce(rows, axis=1)
    above = rows > 0.5 * (low + high)[:, None]
    crossings = np.count_nonzero(above[:, 1:] != above[:, :-1], axis=1)
    largest = np.nanmax(np.abs([low, high]), initial=0.0)
    moving = crossings[high - low > _FLAT * largest]
    slow, fast = np.quantile(0.5 * moving, (0.1, 0.75)) if len(moving) else (0.0, 0.0)
    return float(slow), float(fast)


def overview(t: ArrayLike, u: NodeSeries, dots: int = COLUMNS) -> Raster:
    """Return u over all times and nodes or, if the picture cannot resolve it, its range per period.

    The picture cannot resolve u that jumps within many of the `dots` along time. The same holds if
    the ring has more nodes than the picture has rows, and neighbours differ all around the ring.
    """
    time, slow = np.asarray(t, dtype=np.float64), n_periods(u)[0]
    stride = -(-u.shape[0] // ROWS)
    if slow < 1.0 or (_is_slow(u, dots) and (stride == 1 or _is_smooth(u, stride))):
        return stretch(time, u, float(time[-1] - time[0]), stride=stride)
    low, high = envelope(u, ROWS, min(COLUMNS, int(slow)))
    return Raster(high - low, _edges(time), (0, u.shape[0]), is_range=True)


def close_up(
    t: ArrayLike,
    u: NodeSeries,
    rows: int = ROWS,
    columns: int = COLUMNS,
    shown: int = PERIODS,
) -> Raster:
    """Return u over the last periods, at most over half of the series.

    If the ring has more nodes than rows, equally spaced nodes are shown if neighbours are alike in
    a part of the ring. Otherwise the first nodes are shown.
    """
    time, periods = np.asarray(t, dtype=np.float64), n_periods(u)[1]
    share = min(0.5, shown / max(periods, shown))
    stride = -(-u.shape[0] // rows)
    if stride > _MOST_STRIDE or (stride > 1 and not _is_smooth(u, stride)):
        stride = 1
    made = stretch(time, u, share * float(time[-1] - time[0]), rows, columns, stride)
    said = f"last {shown} of {periods:.0f} periods" if share < 0.5 else "last half"
    return replace(made, length=", ".join(filter(None, [said, made.partly])))


def stretch(
    t: ArrayLike,
    u: NodeSeries,
    duration: float,
    rows: int = ROWS,
    columns: int = COLUMNS,
    stride: int = 1,
) -> Raster:
    """Return u over the last `duration` at some samples, and at every `stride`-th node."""
    time = np.asarray(t, dtype=np.float64)
    count = max(1, int(np.count_nonzero(time >= time[-1] - duration * (1.0 + 1e-9))))
    step = -(-count // columns)
    times = slice((len(time) - 1) % step + (len(time) - count) // step * step, None, step)
    n = min(u.shape[0], rows * stride)
    values = np.array(u[0:n:stride][:, times])
    return Raster(values, _edges(time[times]), (0, n), n == u.shape[0], stride=stride)


def envelope(u: NodeSeries, rows: int, columns: int) -> tuple[Array, Array]:
    """Return smallest and largest value (rows, columns) of u in each dot, NaN left out."""
    n_nodes, n_times = u.shape
    down, across = bins(n_nodes, rows), bins(n_times, columns)
    low, high = np.empty((2, len(down), len(across)))
    for here, nodes in _pieces(down, n_nodes, n_times):
        block, own = u[nodes], down[here] - nodes.start
        for found, reduce in ((low, np.fmin), (high, np.fmax)):
            found[here] = reduce.reduceat(reduce.reduceat(block, across, axis=1), own, axis=0)
    return low, high


def bins(n: int, parts: int) -> NDArray[np.int64]:
    """Divide 0..n-1 into at most `parts` nearly equal parts; return the first number of each."""
    return np.unique(np.linspace(0, n, min(parts, n) + 1).astype(np.int64)[:-1])


def _pieces(starts: NDArray[np.int64], n_nodes: int, n_times: int) -> Iterator[tuple[slice, slice]]:
    """Yield groups of rows of the picture and their nodes, about `_PIECE` samples at a time."""
    ends = np.append(starts[1:], n_nodes)
    at_once = max(1, _PIECE // max(1, n_times * int((ends - starts).max())))
    for i in range(0, len(starts), at_once):
        j = min(i + at_once, len(starts))
        yield slice(i, j), slice(int(starts[i]), int(ends[j - 1]))


def _edges(time: Array) -> tuple[float, float]:
    half = 0.5 * float(time[1] - time[0]) if len(time) > 1 else 0.5
    return float(time[0]) - half, float(time[-1]) + half


def _some(u: NodeSeries) -> Array:
    return u[:: max(1, -(-u.shape[0] // _SOME_NODES))]


def _is_slow(u: NodeSeries, dots: int) -> bool:
    """Whether u changes by more than half of its range within few of the `dots` along time."""
    rows = _some(u)
    low, high = envelope(rows, len(rows), dots)
    following = rows[:, bins(rows.shape[1], dots)[1:]]
    low[:, :-1] = np.fmin(low[:, :-1], following)
    high[:, :-1] = np.fmax(high[:, :-1], following)
    whole = high.max(axis=1, keepdims=True) - low.min(axis=1, keepdims=True)
    moving = whole[:, 0] > _FLAT * np.nanmax(np.abs([low, high]))
    return bool(np.mean((high - low > 0.5 * whole)[moving]) <= _JUMPS)


def _is_smooth(u: NodeSeries, stride: int) -> bool:
    """Whether u is alike at `stride` neighbouring nodes in at least a fifth of the ring."""
    size = min(stride, _SOME_NODES)
    groups = np.stack([u[i : i + size] for i in bins(u.shape[0] - size + 1, _GROUPS).tolist()])
    differences = np.ptp(groups, axis=1).mean(axis=-1)
    return bool(np.quantile(differences, 0.2) <= _SMOOTH * np.ptp(groups))
