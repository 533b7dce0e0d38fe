r"""Kuramoto order parameters of phases: of all nodes, around each node, and of communities.

    R(t)   = | (1/N) sum_j exp(i phi_j) |
    R_k(t) = | (1/n_k) sum_j exp(i phi_j) | ,   j = k and the neighbours of k

Y. Kuramoto, Chemical Oscillations, Waves, and Turbulence (1984), doi:10.1007/978-3-642-69689-3; the
local order parameter: O. E. Omel'chenko, M. Wolfrum, S. Yanchuk, Yu. Maistrenko, O. Sudakov, Phys.
Rev. E 85, 036210 (2012), doi:10.1103/PhysRevE.85.036210. All are in [0, 1] and without a unit. The
number n_k of nodes in the sum divides it, so that equal phases give 1.

Two nodes a quarter of a turn apart have R = sqrt(1/2). In a plane wave phi_k = q k on a ring,
R_k = (1 + 2 cos q) / 3 for nearest neighbours.

>>> quarter = np.array([[0.0, np.pi / 2]])
>>> order_parameter(quarter)
array([0.70710678])
>>> wave = 2 * np.pi * np.arange(6)[None, :] / 6
>>> local_order(wave)[0, :2]
array([0.66666667, 0.66666667])
>>> local_order(wave, itself=False)[0, :2]
array([0.5, 0.5])
>>> community_order(np.array([[0.0, 0.0, 0.0, np.pi]]), [7, 7, 9, 9]).round(9)
array([[1., 0.]])
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures.checks import Array, floats
from chimera_hpc.measures.measure import Orbits
from chimera_hpc.measures.neighbours import NeighbourTable, neighbours

# Unit vectors that a chunk of times holds, so that they stay in the second-level cache.
_VECTORS = 8192


def order_parameter(phase: ArrayLike) -> Array:
    """Order parameter R(t) of all nodes, shape (T,).

    Parameters
    ----------
    phase : array_like, shape (T, N)
        Phases in rad, wrapped or not.

    Raises
    ------
    BadInput
        A wrong shape, or phases that are not real or not finite.
    """
    order: Array = np.abs(_vectors(phase).mean(axis=1))
    return order


def local_order(phase: ArrayLike, pairs: str | ArrayLike = "ring", *, itself: bool = True) -> Array:
    """Order parameter R_k(t) around each node, shape (T, N).

    Parameters
    ----------
    phase : array_like, shape (T, N)
        Phases in rad.
    pairs : "ring", or array_like of int, shape (n, 2)
        Pairs of neighbours, see `neighbours.neighbours`.
    itself : bool
        Whether a node belongs to the nodes around it. If not, a node without neighbours has NaN.

    Raises
    ------
    BadInput
        As `order_parameter`, or pairs that are none.
    """
    vectors = _vectors(phase)
    around = neighbours(pairs, vectors.shape[1])
    total = vectors.copy() if itself else np.zeros_like(vectors)
    owner = np.repeat(np.arange(vectors.shape[1]), around.degrees)
    np.add.at(total.T, owner, vectors.T[around.indices])
    counts = (around.degrees + itself).astype(np.float64)
    return np.abs(total) / np.where(counts > 0, counts, np.nan)


def community_order(phase: ArrayLike, communities: ArrayLike) -> Array:
    """Order parameter of each community, shape (T, C).

    Parameters
    ----------
    phase : array_like, shape (T, N)
        Phases in rad.
    communities : array_like, shape (N,)
        A label for each node. The C communities come in the order of their sorted labels.

    Raises
    ------
    BadInput
        As `order_parameter`, or not one label per node.
    """
    vectors = _vectors(phase)
    members = community_members(communities, vectors.shape[1])
    return np.stack([np.abs(vectors[:, nodes].mean(axis=1)) for nodes in members], axis=1)


def community_members(communities: ArrayLike, n_nodes: int) -> list[NDArray[np.int64]]:
    """Return the nodes of each community. Raises BadInput: not one label per node."""
    labels = np.asarray(communities)
    if labels.shape != (n_nodes,):
        raise BadInput(f"communities: one label for each of {n_nodes} nodes, not {labels.shape}")
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]


def _vectors(phase: ArrayLike) -> NDArray[np.complex128]:
    angle = floats("phase", phase)
    if angle.ndim != 2 or angle.size == 0:
        raise BadInput(f"phase must have shape (times, nodes), not {angle.shape}")
    if not np.isfinite(angle).all():
        raise BadInput("phase must be finite")
    vectors: NDArray[np.complex128] = np.exp(1j * angle)
    return vectors


class RunOrders(NamedTuple):
    """Order parameters of a run by the angles of (u, w) about each node's mean point."""

    mean: float
    """Time mean of R."""
    deviation: float
    """Standard deviation in time of R."""
    local: Array
    """Time mean of R_k around each node, (N,)."""


def run_orders(orbits: Orbits, around: NeighbourTable) -> RunOrders:
    """Order parameters of a run and its neighbours, in one pass without a phase.

    As `order_parameter` and `local_order` of `phase_angles.phases`, "geometric".
    """
    n_nodes, n_times = orbits.x.shape
    local, sums = np.zeros(n_nodes), np.zeros(2)
    _orders(orbits, around.indptr, around.indices, _work(n_nodes), local, sums)
    mean, square = sums / n_times
    return RunOrders(mean, np.sqrt(max(square - mean * mean, 0.0)), local / n_times)


def run_communities(
    orbits: Orbits, members: Sequence[NDArray[np.int64]]
) -> tuple[Array, Array, float]:
    """Return mean and variance in time of R_c (C,), and the time mean of its variance over c.

    As `community_order` of the geometric phases. Variances are those of the population.
    """
    n_nodes, n_times = orbits.x.shape
    bounds = np.cumsum([0, *map(len, members)])
    sums, total = np.zeros((2, len(members))), np.zeros(1)
    _communities(orbits, bounds, np.concatenate(members), _work(n_nodes), sums, total)
    mean, square = sums / n_times
    return mean, np.maximum(square - mean * mean, 0.0), float(total[0] / n_times)


class _Work(NamedTuple):
    """Unit vectors of a chunk of times (2, N, chunk), and their sums (4, chunk)."""

    vectors: Array
    sums: Array


def _work(n_nodes: int) -> _Work:
    chunk = max(8, _VECTORS // n_nodes)
    return _Work(np.empty((2, n_nodes, chunk)), np.empty((4, chunk)))


@jit()
def _unit(orbits: Any, start: int, n: int, vectors: Any) -> None:
    """Write unit vectors from the mean points, n times from start, into vectors (2, N, chunk)."""
    x, y = orbits.x, orbits.y
    for j in range(x.shape[0]):
        along, across = vectors[0, j], vectors[1, j]
        for i in range(n):
            dx = x[j, start + i] - orbits.x_mean[j]
            dy = y[j, start + i] - orbits.y_mean[j]
            radius = np.sqrt(dx * dx + dy * dy)
            still = radius == 0.0
            scale = 1.0 / (1.0 if still else radius)
            along[i] = 1.0 if still else dx * scale
            across[i] = dy * scale


@jit()
def _add(vectors: Any, j: int, n: int, total: Any) -> None:
    """Add the vectors of a node to total (2, chunk)."""
    along, across = total[0], total[1]
    x, y = vectors[0, j], vectors[1, j]
    for i in range(n):
        along[i] += x[i]
        across[i] += y[i]


@jit()
def _orders(orbits: Any, indptr: Any, indices: Any, work: Any, local: Any, sums: Any) -> None:
    """Add R and R^2 of all times to sums (2,), and R_k of all times to local (N,)."""
    n_nodes, n_times = orbits.x.shape
    vectors, total = work.vectors, work.sums
    for start in range(0, n_times, vectors.shape[2]):
        n = min(vectors.shape[2], n_times - start)
        _unit(orbits, start, n, vectors)
        total[:2, :n] = 0.0
        for j in range(n_nodes):
            _add(vectors, j, n, total)
        _lengths(total, n)
        for i in range(n):
            sums[0] += total[2, i] / n_nodes
            sums[1] += total[2, i] * total[2, i] / (n_nodes * n_nodes)
        for j in range(n_nodes):
            _around(vectors, j, indices[indptr[j] : indptr[j + 1]], n, total)
            length = 0.0
            for i in range(n):
                length += total[2, i]
            local[j] += length / (1 + indptr[j + 1] - indptr[j])


@jit()
def _around(vectors: Any, j: int, others: Any, n: int, total: Any) -> None:
    """Write the length of the sum of the vectors of a node and of others into total[2]."""
    x, y, length = vectors[0], vectors[1], total[2]
    if others.size == 2:  # on a ring: in one pass
        a, b = others
        for i in range(n):
            along = x[j, i] + x[a, i] + x[b, i]
            across = y[j, i] + y[a, i] + y[b, i]
            length[i] = np.sqrt(along * along + across * across)
        return
    for i in range(n):
        total[0, i] = x[j, i]
        total[1, i] = y[j, i]
    for k in others:
        _add(vectors, k, n, total)
    _lengths(total, n)


@jit()
def _lengths(total: Any, n: int) -> None:
    """Write the lengths of n vectors total[:2] into total[2]."""
    along, across, length = total[0], total[1], total[2]
    for i in range(n):
        length[i] = np.sqrt(along[i] * along[i] + across[i] * across[i])


@jit()
def _communities(orbits: Any, bounds: Any, nodes: Any, work: Any, sums: Any, variance: Any) -> None:
    """Add R_c and R_c^2 of all times to sums (2, C), their variances over c to variance (1,)."""
    n_times, n_communities = orbits.x.shape[1], bounds.size - 1
    vectors, total = work.vectors, work.sums
    for start in range(0, n_times, vectors.shape[2]):
        n = min(vectors.shape[2], n_times - start)
        _unit(orbits, start, n, vectors)
        total[2:, :n] = 0.0
        for c in range(n_communities):
            total[:2, :n] = 0.0
            size = bounds[c + 1] - bounds[c]
            for k in range(bounds[c], bounds[c + 1]):
                _add(vectors, nodes[k], n, total)
            for i in range(n):
                square = total[0, i] * total[0, i] + total[1, i] * total[1, i]
                square /= size * size
                order = np.sqrt(square)
                total[2, i] += order
                total[3, i] += square
                sums[0, c] += order
                sums[1, c] += square
        for i in range(n):
            mean = total[2, i] / n_communities
            variance[0] += max(total[3, i] / n_communities - mean * mean, 0.0)
