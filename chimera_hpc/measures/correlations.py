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
from chimera_hpc.measures.neighbours import neighbours

# Largest curvature, as a share of the range of u, that rounding alone gives.
_NOISE = 1e-9
_CHUNK = 256
_DELTA = 0.01


class _Field(NamedTuple):
    """A run: real and imaginary part, or u alone if it is real."""

    parts: Array
    """(1 or 2, N, T)"""
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


def run_correlations(u: ArrayLike, pairs: str | ArrayLike) -> tuple[Array, Array, float]:
    """Return g0 (T,) over pairs of neighbours and over all pairs, and h0, of a run u (T, N)."""
    field = _field(u)
    h = _h0(field, _DELTA, relative=True) if field.parts.shape[1] > 1 else math.nan
    return _g0(field, pairs, _DELTA), _g0(field, "global", _DELTA), h


def _g0(field: _Field, pairs: str | ArrayLike, delta: float) -> Array:
    parts, noise = field
    n_nodes, n_times = parts.shape[1:]
    found = np.zeros(n_times)
    if isinstance(pairs, str) and pairs == "global":
        n_pairs = n_nodes * (n_nodes - 1) // 2
        largest = _farthest(parts)
        if n_pairs == 0 or largest <= noise:
            return np.ones(n_times)
        _count_pairs(parts, delta * largest, np.empty((4, _CHUNK)), found)
        correlation: Array = np.sqrt(found / n_pairs)
        return correlation
    around = neighbours(pairs, n_nodes)
    work = np.empty((4, _CHUNK))
    largest = _curvature(parts, *around, math.inf, work, found)
    if largest <= noise:
        return np.ones(n_times)
    found[:] = 0
    _curvature(parts, *around, delta * largest, work, found)
    share: Array = found / n_nodes
    return share


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
    parts = field.parts
    n_nodes = parts.shape[1]
    rho = _correlations(parts)[np.triu_indices(n_nodes, 1)]
    largest = float(rho.max()) if relative else 1.0
    # Rounding may leave the |rho| of equal signals below 1.
    close = rho >= (1.0 - delta) * largest - 1e-14
    return math.sqrt(np.count_nonzero(close) / rho.size) if largest > 0 else 0.0


def _field(u: ArrayLike) -> _Field:
    """Return u (T, N), checked."""
    values = np.asarray(u)
    if values.dtype.kind == "c":
        parts = np.stack([node_rows("u", part) for part in (values.real, values.imag)])
    else:
        parts = node_rows("u", u)[None]
    low, high = parts.min(axis=(1, 2)), parts.max(axis=(1, 2))
    if not np.isfinite(low + high).all():
        raise BadInput("u must be finite")
    return _Field(parts, _NOISE * float((high - low).max()))


def _check_delta(delta: float) -> None:
    if not 0.0 < delta <= 1.0:
        raise BadInput(f"delta must be in (0, 1], not {delta}")


def _farthest(parts: Array) -> float:
    """Return the largest distance of two nodes at one time."""
    if len(parts) == 1:
        return float((parts[0].max(axis=0) - parts[0].min(axis=0)).max())
    nothing = np.zeros(parts.shape[2])
    return float(_count_pairs(parts, 0.0, np.empty((4, _CHUNK)), nothing))


def _correlations(parts: Array) -> NDArray[np.float64]:
    """Return the modulus of the correlation coefficients of all pairs, (N, N)."""
    n_nodes, n_times = parts.shape[1:]
    mean = parts.mean(axis=2, keepdims=True)
    product = np.zeros((n_nodes, n_nodes), dtype=np.float64 if len(parts) == 1 else np.complex128)
    # In chunks of times: a centred copy of the whole run costs more than the products.
    for start in range(0, n_times, _CHUNK):
        centred = parts[:, :, start : start + _CHUNK] - mean
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
def _curvature(parts: Any, indptr: Any, indices: Any, limit: float, work: Any, found: Any) -> float:
    """Add to found (T,) the number of nodes with a curvature < limit; return the largest."""
    n_parts, n_nodes, n_times = parts.shape
    size, here, count, most = work[0], work[1], work[2], work[3]
    most[:] = 0.0
    for start in range(0, n_times, size.size):
        n = min(size.size, n_times - start)
        count[:n] = 0.0
        for j in range(n_nodes):
            degree = indptr[j + 1] - indptr[j]
            for p in range(n_parts):
                x = parts[p, j, start : start + n]
                for i in range(n):
                    here[i] = -degree * x[i]
                for k in range(indptr[j], indptr[j + 1]):
                    other = parts[p, indices[k], start : start + n]
                    for i in range(n):
                        here[i] += other[i]
                if p == 0:
                    for i in range(n):
                        size[i] = abs(here[i])
            if n_parts > 1:
                for i in range(n):
                    size[i] = np.sqrt(size[i] * size[i] + here[i] * here[i])
            _tally(size, limit, n, count, most)
        for i in range(n):
            found[start + i] += count[i]
    largest: float = _largest(most)
    return largest


@jit()
def _count_pairs(parts: Any, limit: float, work: Any, found: Any) -> float:
    """Add to found (T,) the number of pairs with a distance < limit; return the largest."""
    n_parts, n_nodes, n_times = parts.shape
    size, count, most = work[0], work[2], work[3]
    most[:] = 0.0
    for start in range(0, n_times, size.size):
        n = min(size.size, n_times - start)
        count[:n] = 0.0
        for j in range(n_nodes):
            one = parts[0, j, start : start + n]
            for k in range(j):
                other = parts[0, k, start : start + n]
                if n_parts == 1:
                    for i in range(n):
                        count[i] += 1.0 if abs(one[i] - other[i]) < limit else 0.0
                    continue
                for i in range(n):
                    dx = one[i] - other[i]
                    dy = parts[1, j, start + i] - parts[1, k, start + i]
                    size[i] = np.sqrt(dx * dx + dy * dy)
                _tally(size, limit, n, count, most)
        for i in range(n):
            found[start + i] += count[i]
    largest: float = _largest(most)
    return largest


@jit()
def _tally(size: Any, limit: float, n: int, count: Any, most: Any) -> None:
    """Count the first n sizes that are < limit, and keep the largest of each place."""
    for i in range(n):
        count[i] += 1.0 if size[i] < limit else 0.0
        most[i] = size[i] if size[i] > most[i] else most[i]


@jit()
def _largest(values: Any) -> float:
    most = 0.0
    for value in values:
        most = max(most, value)
    return most
