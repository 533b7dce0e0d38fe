r"""Correlation in space and in time of a field of oscillators: g0 and h0 (Kemeth et al. 2016).

F. P. Kemeth, S. W. Haugland, L. Schmidt, I. G. Kevrekidis, K. Krischer, Chaos 26, 094815 (2016),
doi:10.1063/1.4959804. With the local curvature D_i of node i, over its neighbours j, and the
distance d_ij of two nodes,

    D_i = | sum_j (u_j - u_i) | ,       on a ring | u_{i-1} - 2 u_i + u_{i+1} | ,
    d_ij = | u_i - u_j | ,

and D_max, d_max the largest over all nodes or pairs and times,

    g0(t) = share of nodes with D_i(t) < delta D_max ,
    g0(t) = sqrt( share of pairs with d_ij(t) < delta d_max )            (no geometry: "global") ,
    h0    = sqrt( share of pairs with |rho_ij| >= 1 - delta ) ,

rho_ij the correlation coefficient in time of u_i and u_j. g0 is 1 for coherent and 0 for incoherent
states, between for chimeras; h0 > 0 tells that the pattern does not travel. The scale is that of
the run itself, so a smooth wave has g0 < 1. A field without any curvature has g0 = 1.

>>> step = np.array([[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]])
>>> g0(step), g0(step, "global")  # 4 of 8 nodes; 12 of 28 pairs
(array([0.5]), array([0.65465367]))
>>> t = np.linspace(0, 2 * np.pi, 400, endpoint=False)[:, None]
>>> h0(np.hstack([np.sin(t), 2 * np.sin(t), np.cos(t)]))  # 1 of 3 pairs
0.577350
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures.checks import Array, node_rows
from chimera_hpc.measures.neighbours import NeighbourTable, neighbours

# Largest curvature, as a share of the range of u, that rounding alone gives.
_NOISE = 1e-9
_CHUNK = 256
_PRODUCT_CHUNK = 1024
_DELTA = 0.01


class _Field(NamedTuple):
    """A run: real and imaginary part, or u alone if it is real."""

    parts: Array
    """(1 or 2, N, T)"""
    mean: Array
    """(1 or 2, N)"""
    noise: float
    """Largest curvature or distance that counts as none."""


def g0(u: ArrayLike, pairs: str | ArrayLike = "ring", delta: float = _DELTA) -> Array:
    """Spatial correlation of a run at each time, shape (T,).

    Parameters
    ----------
    u : array_like, shape (T, N)
        Real, or complex: pass ``exp(1j * phase)`` for phases.
    pairs : "ring", "global", or array_like of int, shape (n, 2)
        Curvature along a ring or over the given pairs of neighbours, or distances of all pairs of
        nodes.
    delta : float
        Threshold, a share of the largest curvature or distance, in (0, 1].

    Raises
    ------
    BadInput
        A wrong shape, values that are not finite, or an option that is not allowed.
    """
    _check_delta(delta)
    return _g0(_field(u), pairs, delta)


def run_correlations(
    rows: Array, mean: Array, around: NeighbourTable
) -> tuple[Array, Array, float]:
    """Return g0 (T,) over neighbours and over all pairs, and h0, of rows (N, T) and their means."""
    field = _checked(rows[None], mean[None])
    h = _h0(field, _DELTA, relative=True) if len(rows) > 1 else math.nan
    return _share_of_nodes(field, around, _DELTA), _share_of_pairs(field, _DELTA), h


def _g0(field: _Field, pairs: str | ArrayLike, delta: float) -> Array:
    if isinstance(pairs, str) and pairs == "global":
        return _share_of_pairs(field, delta)
    return _share_of_nodes(field, neighbours(pairs, field.parts.shape[1]), delta)


def _share_of_nodes(field: _Field, around: NeighbourTable, delta: float) -> Array:
    n_nodes, n_times = field.parts.shape[1:]
    found = np.zeros(n_times)
    largest = _curvature(field.parts, *around, math.inf, *_work(), found)
    if largest <= field.noise:
        return np.ones(n_times)
    found[:] = 0
    _curvature(field.parts, *around, delta * largest, *_work(), found)
    share: Array = found / n_nodes
    return share


def _share_of_pairs(field: _Field, delta: float) -> Array:
    n_nodes, n_times = field.parts.shape[1:]
    found = np.zeros(n_times)
    n_pairs = n_nodes * (n_nodes - 1) // 2
    largest = _farthest(field.parts)
    if n_pairs == 0 or largest <= field.noise:
        return np.ones(n_times)
    _count_pairs(field.parts, delta * largest, *_work(), found)
    correlation: Array = np.sqrt(found / n_pairs)
    return correlation


def _work() -> tuple[Array, NDArray[np.int64]]:
    return np.empty((3, _CHUNK)), np.empty(_CHUNK, dtype=np.int64)


def h0(u: ArrayLike, delta: float = _DELTA, *, relative: bool = True) -> float:
    """Temporal correlation h0 of a run.

    Parameters
    ----------
    u : array_like, shape (T, N)
        Real, or complex: pass ``exp(1j * phase)`` for phases.
    delta : float
        Threshold in (0, 1].
    relative : bool
        Divide all ``|rho|`` by the largest of them first, as the authors' program
        classify-chimeras does. If False, as in the paper; the two differ where no pair of nodes is
        fully correlated.

    Two nodes that never change count as correlated, and one of them with any other node as not.
    Takes memory for N^2 numbers.

    Raises
    ------
    BadInput
        As `g0`; or fewer than two nodes.
    """
    field = _field(u)
    _check_delta(delta)
    if field.parts.shape[1] < 2:
        raise BadInput("h0 needs at least two nodes")
    return _h0(field, delta, relative)


def _h0(field: _Field, delta: float, relative: bool) -> float:
    n_nodes = field.parts.shape[1]
    rho = _correlations(field)
    rho[np.tri(n_nodes, dtype=np.bool_)] = -1.0  # each pair once
    largest = float(rho.max()) if relative else 1.0
    # Rounding may leave the |rho| of equal signals below 1.
    close = np.count_nonzero(rho >= (1.0 - delta) * largest - 1e-14)
    return math.sqrt(close / (n_nodes * (n_nodes - 1) // 2)) if largest > 0 else 0.0


def _field(u: ArrayLike) -> _Field:
    """Return u (T, N), checked."""
    values = np.asarray(u)
    if values.dtype.kind == "c":
        parts = np.stack([node_rows("u", part) for part in (values.real, values.imag)])
    else:
        parts = node_rows("u", u)[None]
    return _checked(parts, parts.mean(axis=2))


def _checked(parts: Array, mean: Array) -> _Field:
    low, high = parts.min(axis=(1, 2)), parts.max(axis=(1, 2))
    if not np.isfinite(low + high).all():
        raise BadInput("u must be finite")
    return _Field(parts, mean, _NOISE * float((high - low).max()))


def _check_delta(delta: float) -> None:
    if not 0.0 < delta <= 1.0:
        raise BadInput(f"delta must be in (0, 1], not {delta}")


def _farthest(parts: Array) -> float:
    """Return the largest distance of two nodes at one time."""
    if len(parts) == 1:
        return float((parts[0].max(axis=0) - parts[0].min(axis=0)).max())
    return float(_count_pairs(parts, 0.0, *_work(), np.zeros(parts.shape[2])))


def _correlations(field: _Field) -> NDArray[np.float64]:
    """Return the modulus of the correlation coefficients of all pairs, (N, N)."""
    parts, mean, _ = field
    n_nodes, n_times = parts.shape[1:]
    product = np.zeros((n_nodes, n_nodes), dtype=np.float64 if len(parts) == 1 else np.complex128)
    # In chunks of times: a centred copy of the whole run costs more than the products.
    for start in range(0, n_times, _PRODUCT_CHUNK):
        centred = parts[:, :, start : start + _PRODUCT_CHUNK] - mean[:, :, None]
        z = centred[0] if len(parts) == 1 else centred[0] + 1j * centred[1]
        product += z @ (z.T if len(parts) == 1 else z.conj().T)
    size: NDArray[np.float64] = np.abs(product)
    length = np.sqrt(np.diag(size))
    still = length <= 1e-15 * max(-parts.min(), parts.max()) * math.sqrt(n_times)
    scale = np.where(still, 1.0, length)
    size /= scale[:, None] * scale
    size[still] = size[:, still] = 0.0
    size[np.ix_(still, still)] = 1.0
    return size


@jit()
def _curvature(
    parts: Any, indptr: Any, indices: Any, limit: float, work: Any, count: Any, found: Any
) -> float:
    """Add to found (T,) the number of nodes with a curvature < limit; return the largest."""
    n_parts, n_nodes, n_times = parts.shape
    size, here, most = work[0], work[1], work[2]
    most[:] = 0.0
    for start in range(0, n_times, count.size):
        n = min(count.size, n_times - start)
        count[:n] = 0
        for j in range(n_nodes):
            others = indices[indptr[j] : indptr[j + 1]]
            _bend(parts[0], j, others, start, n, size)
            if n_parts > 1:
                _bend(parts[1], j, others, start, n, here)
                for i in range(n):
                    size[i] = np.sqrt(size[i] * size[i] + here[i] * here[i])
            _tally(size, limit, n, count, most)
        for i in range(n):
            found[start + i] += count[i]
    largest: float = _largest(most)
    return largest


@jit()
def _bend(rows: Any, j: int, others: Any, start: int, n: int, here: Any) -> None:
    """Write the sum of the differences of others and a node j, n times from start."""
    degree = float(others.size)
    x = rows[j, start : start + n]
    if others.size == 2:  # on a ring: in one pass
        a, b = rows[others[0], start : start + n], rows[others[1], start : start + n]
        for i in range(n):
            here[i] = -degree * x[i] + a[i] + b[i]
        return
    for i in range(n):
        here[i] = -degree * x[i]
    for k in others:
        other = rows[k, start : start + n]
        for i in range(n):
            here[i] += other[i]


@jit()
def _count_pairs(parts: Any, limit: float, work: Any, count: Any, found: Any) -> float:
    """Add to found (T,) the number of pairs with a distance < limit.

    Return the largest distance, of two parts only.
    """
    n_parts, n_nodes, n_times = parts.shape
    size, most = work[0], work[2]
    most[:] = 0.0
    for start in range(0, n_times, count.size):
        n = min(count.size, n_times - start)
        count[:n] = 0
        for j in range(n_nodes):
            if n_parts == 1:
                _count_near(parts[0], j, start, limit, count[:n])
                continue
            for k in range(j):
                for i in range(start, start + n):
                    dx = parts[0, j, i] - parts[0, k, i]
                    dy = parts[1, j, i] - parts[1, k, i]
                    size[i - start] = np.sqrt(dx * dx + dy * dy)
                _tally(size, limit, n, count, most)
        for i in range(n):
            found[start + i] += count[i]
    largest: float = _largest(most)
    return largest


@jit()
def _count_near(rows: Any, j: int, start: int, limit: float, count: Any) -> None:
    """Count at each time the nodes before j that are near j, four at a time."""
    n = count.size
    one = rows[j, start : start + n]
    whole = j - j % 4
    for k in range(0, whole, 4):
        a, b = rows[k, start : start + n], rows[k + 1, start : start + n]
        c, d = rows[k + 2, start : start + n], rows[k + 3, start : start + n]
        for i in range(n):
            near = np.int64(abs(one[i] - a[i]) < limit) + np.int64(abs(one[i] - b[i]) < limit)
            near += np.int64(abs(one[i] - c[i]) < limit) + np.int64(abs(one[i] - d[i]) < limit)
            count[i] += near
    for k in range(whole, j):
        other = rows[k, start : start + n]
        for i in range(n):
            count[i] += np.int64(abs(one[i] - other[i]) < limit)


@jit()
def _tally(size: Any, limit: float, n: int, count: Any, most: Any) -> None:
    """Count the first n sizes that are < limit, and keep the largest of each place."""
    for i in range(n):
        here = abs(size[i])
        count[i] += np.int64(here < limit)
        most[i] = here if here > most[i] else most[i]


@jit()
def _largest(values: Any) -> float:
    most = 0.0
    for value in values:
        most = max(most, value)
    return most
