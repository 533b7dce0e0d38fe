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
    periods: tuple[float, float] | None = None
    """What `n_periods` returns of the series, where it was asked for."""

    @property
    def partly(self) -> str:
        """The nodes that are drawn, in words; empty if all are drawn."""
        if self.stride > 1:
            return f"one node in {self.stride}"
        return "" if self.is_whole else f"nodes {self.nodes[0]} to {self.nodes[1] - 1}"


@dataclass(frozen=True)
class _FewNodes:
    """What a few nodes, equally spaced, say about a series."""

    periods: tuple[float, float]
    """As `n_periods` returns them."""
    low: Array
    high: Array
    """(nodes, dots) smallest and largest u from each dot to the first sample of the next."""


def n_periods(u: NodeSeries) -> tuple[float, float]:
    """Return the number of periods of a slow and of a fast node, from crossings of the mid-level.

    These are the quantiles 0.1 and 0.75 over the nodes that oscillate; 0 if no node does.
    """
    return _few_nodes(u, 1).periods


def overview(t: ArrayLike, u: NodeSeries, dots: int = COLUMNS) -> Raster:
    """Return u over all times and nodes or, if the picture cannot resolve it, its range per period.

    The picture cannot resolve u that jumps within many of the `dots` along time. The same holds if
    the ring has more nodes than the picture has rows, and neighbours differ all around the ring.
    """
    time, few = np.asarray(t, dtype=np.float64), _few_nodes(u, dots)
    slow, stride = few.periods[0], -(-u.shape[0] // ROWS)
    if slow < 1.0 or (_is_slow(few) and (stride == 1 or _is_smooth(u, stride))):
        made = stretch(time, u, float(time[-1] - time[0]), stride=stride)
        return replace(made, periods=few.periods)
    low, high = envelope(u, ROWS, min(COLUMNS, int(slow)))
    nodes, is_range = (0, u.shape[0]), True
    return Raster(high - low, _edges(time), nodes, is_range=is_range, periods=few.periods)


def close_up(
    t: ArrayLike,
    u: NodeSeries,
    rows: int = ROWS,
    columns: int = COLUMNS,
    shown: int = PERIODS,
    counted: tuple[float, float] | None = None,
) -> Raster:
    """Return u over the last periods, at most over half of the series.

    If the ring has more nodes than rows, equally spaced nodes are shown if neighbours are alike in
    a part of the ring. Otherwise the first nodes are shown. `counted` is what `n_periods` returns,
    if it is known.
    """
    time, periods = np.asarray(t, dtype=np.float64), (counted or n_periods(u))[1]
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
    values = np.concatenate([block[:, times] for block in _every(u, stride, n)])
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


def _every(u: NodeSeries, stride: int, end: int) -> Iterator[Array]:
    """Yield u of every `stride`-th node before `end`, about `_PIECE` samples at a time."""
    nodes = stride * max(1, _PIECE // max(1, u.shape[1]))
    for first in range(0, end, nodes):
        yield u[first : min(first + nodes, end) : stride]


def _few_nodes(u: NodeSeries, dots: int) -> _FewNodes:
    low, high, crossings, dot_low, dot_high = zip(
        *(_ranges(rows, dots) for rows in _every(u, -(-u.shape[0] // _SOME_NODES), u.shape[0])),
        strict=True,
    )
    ranges = np.array([np.concatenate(low), np.concatenate(high)])
    largest = np.nanmax(np.abs(ranges), initial=0.0)
    moving = np.concatenate(crossings)[ranges[1] - ranges[0] > _FLAT * largest]
    slow, fast = np.quantile(0.5 * moving, (0.1, 0.75)) if len(moving) else (0.0, 0.0)
    periods = (float(slow), float(fast))
    return _FewNodes(periods, np.concatenate(dot_low), np.concatenate(dot_high))


def _ranges(rows: Array, dots: int) -> tuple[Array, Array, NDArray[np.int64], Array, Array]:
    """Return the range of rows (n, T), the crossings of its middle, and the range in each dot."""
    low, high = np.fmin.reduce(rows, axis=1), np.fmax.reduce(rows, axis=1)
    above = rows > 0.5 * (low + high)[:, None]
    crossings = np.count_nonzero(above[:, 1:] != above[:, :-1], axis=1)
    dot_low, dot_high = envelope(rows, len(rows), dots)
    following = rows[:, bins(rows.shape[1], dots)[1:]]
    dot_low[:, :-1] = np.fmin(dot_low[:, :-1], following)
    dot_high[:, :-1] = np.fmax(dot_high[:, :-1], following)
    return low, high, crossings, dot_low, dot_high


def _is_slow(few: _FewNodes) -> bool:
    """Whether u changes by more than half of its range within few of the dots along time."""
    low, high = few.low, few.high
    whole = high.max(axis=1, keepdims=True) - low.min(axis=1, keepdims=True)
    moving = whole[:, 0] > _FLAT * np.nanmax(np.abs([low, high]))
    return bool(np.mean((high - low > 0.5 * whole)[moving]) <= _JUMPS)


def _is_smooth(u: NodeSeries, stride: int) -> bool:
    """Whether u is alike at `stride` neighbouring nodes in at least a fifth of the ring."""
    size = min(stride, _SOME_NODES)
    differences, low, high = [], [], []
    for i in bins(u.shape[0] - size + 1, _GROUPS).tolist():
        group = u[i : i + size]
        differences.append(np.ptp(group, axis=0).mean())
        low.append(group.min())
        high.append(group.max())
    return bool(np.quantile(differences, 0.2) <= _SMOOTH * (np.max(high) - np.min(low)))
