r"""Correlation in space and in time of a field of oscillators: g0 and h0 (Kemeth et al. 2016).

F. P. Kemeth, S. W. Haugland, L. Schmidt, I. G. Kevrekidis, K. Krischer, Chaos 26, 094815 (2016),
doi:10.1063/1.4959804. The local curvature of node i is D_i = |sum_j (u_j - u_i)| over its
neighbours j; on a ring this is |u_{i-1} - 2 u_i + u_{i+1}|. With D_max the largest over all nodes
and times, and d_ij = |u_i - u_j|, d_max the largest over all pairs and times,

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
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures.checks import Array, node_rows
from chimera_hpc.measures.neighbours import neighbours

# Largest curvature, as a share of the range of u, that rounding alone gives.
_NOISE = 1e-9
_CHUNK = 512


def g0(u: ArrayLike, pairs: str | ArrayLike = "ring", delta: float = 0.01) -> Array:
    """Spatial correlation g0(t), shape (T,).

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
    parts = _parts(u)
    _check_delta(delta)
    n_nodes, n_times = parts.shape[1:]
    found = np.zeros(n_times, dtype=np.int64)
    if isinstance(pairs, str) and pairs == "global":
        n_pairs = n_nodes * (n_nodes - 1) // 2
        largest = _farthest(parts)
        if n_pairs == 0 or largest <= _noise(parts):
            return np.ones(n_times)
        _count_pairs(parts, delta * largest, np.empty((2, _CHUNK)), found)
        return np.sqrt(found / n_pairs)
    around = neighbours(pairs, n_nodes)
    work = np.empty((2, _CHUNK))
    largest = _curvature(parts, *around, math.inf, work, found)
    if largest <= _noise(parts):
        return np.ones(n_times)
    found[:] = 0
    _curvature(parts, *around, delta * largest, work, found)
    return found / n_nodes


def h0(u: ArrayLike, delta: float = 0.01, *, relative: bool = True) -> float:
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
    parts = _parts(u)
    _check_delta(delta)
    n_nodes = parts.shape[1]
    if n_nodes < 2:
        raise BadInput("h0 needs at least two nodes")
    rho = _correlations(parts)[np.triu_indices(n_nodes, 1)]
    largest = float(rho.max()) if relative else 1.0
    # Rounding may leave the |rho| of equal signals below 1.
    close = rho >= (1.0 - delta) * largest - 1e-14
    return math.sqrt(np.count_nonzero(close) / rho.size) if largest > 0 else 0.0


def _parts(u: ArrayLike) -> Array:
    """Return real and imaginary part of u (T, N), or u alone if it is real, as (1 or 2, N, T)."""
    values = np.asarray(u)
    both = (values.real, values.imag) if values.dtype.kind == "c" else (u,)
    parts = np.stack([node_rows("u", part) for part in both])
    if not np.isfinite(parts.min() + parts.max()):
        raise BadInput("u must be finite")
    return parts


def _check_delta(delta: float) -> None:
    if not 0.0 < delta <= 1.0:
        raise BadInput(f"delta must be in (0, 1], not {delta}")


def _noise(parts: Array) -> float:
    return _NOISE * float((parts.max(axis=(1, 2)) - parts.min(axis=(1, 2))).max())


def _farthest(parts: Array) -> float:
    """Return the largest distance of two nodes at one time."""
    if len(parts) == 1:
        return float((parts[0].max(axis=0) - parts[0].min(axis=0)).max())
    nothing = np.zeros(parts.shape[2], dtype=np.int64)
    return float(_count_pairs(parts, 0.0, np.empty((2, _CHUNK)), nothing))


def _correlations(parts: Array) -> NDArray[np.float64]:
    """Return the modulus of the correlation coefficients of all pairs, (N, N)."""
    centred = parts - parts.mean(axis=2, keepdims=True)
    z = centred[0] if len(parts) == 1 else centred[0] + 1j * centred[1]
    length = np.sqrt(np.einsum("knt,knt->n", centred, centred))
    still = length <= 1e-15 * np.abs(parts).max() * math.sqrt(parts.shape[2])
    z /= np.where(still, 1.0, length)[:, None]
    rho: NDArray[np.float64] = np.abs(z.conj() @ z.T) if len(parts) == 2 else np.abs(z @ z.T)
    rho[still] = rho[:, still] = 0.0
    rho[np.ix_(still, still)] = 1.0
    return rho


@jit()
def _curvature(parts: Any, indptr: Any, indices: Any, limit: float, work: Any, found: Any) -> float:
    """Add to found (T,) the number of nodes with a curvature < limit; return the largest."""
    n_parts, n_nodes, n_times = parts.shape
    largest = 0.0
    size = work[0]
    here = work[1]
    for start in range(0, n_times, here.size):
        n = min(here.size, n_times - start)
        for j in range(n_nodes):
            degree = indptr[j + 1] - indptr[j]
            size[:n] = 0.0
            for p in range(n_parts):
                for i in range(n):
                    here[i] = -degree * parts[p, j, start + i]
                for k in range(indptr[j], indptr[j + 1]):
                    other = parts[p, indices[k], start : start + n]
                    for i in range(n):
                        here[i] += other[i]
                for i in range(n):
                    size[i] += here[i] * here[i] if n_parts > 1 else abs(here[i])
            for i in range(n):
                curvature = np.sqrt(size[i]) if n_parts > 1 else size[i]
                largest = max(largest, curvature)
                found[start + i] += curvature < limit
    return largest


@jit()
def _count_pairs(parts: Any, limit: float, work: Any, found: Any) -> float:
    """Add to found (T,) the number of pairs with a distance < limit; return the largest."""
    n_parts, n_nodes, n_times = parts.shape
    largest = 0.0
    chunk = work.shape[1]
    for start in range(0, n_times, chunk):
        n = min(chunk, n_times - start)
        for j in range(n_nodes):
            for k in range(j):
                if n_parts == 1:
                    one = parts[0, j, start : start + n]
                    other = parts[0, k, start : start + n]
                    for i in range(n):
                        found[start + i] += abs(one[i] - other[i]) < limit
                else:
                    for i in range(n):
                        dx = parts[0, j, start + i] - parts[0, k, start + i]
                        dy = parts[1, j, start + i] - parts[1, k, start + i]
                        distance = np.sqrt(dx * dx + dy * dy)
                        largest = max(largest, distance)
                        found[start + i] += distance < limit
    return largest
