"""Boundary matrices of oriented links and triangles, and linear algebra with Hodge Laplacians."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network.checks import Array, Integers, pair_keys

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MOST_DENSE = 2000
"""Largest matrix that is factorised as a dense one."""


def boundary_of_links(n_nodes: int, links: Integers, weights: Array | None) -> csr_array:
    """Return B_1 W^(1/2), shape (N0, N1): +1 at heads and -1 at tails, times sqrt(weight)."""
    from scipy.sparse import csr_array

    index = np.arange(len(links))
    rows = np.concatenate([links[:, 1], links[:, 0]])
    values = np.repeat([1.0, -1.0], len(links))
    if weights is not None:
        values *= np.tile(np.sqrt(weights), 2)
    shape = (n_nodes, len(links))
    return csr_array((values, (rows, np.concatenate([index, index]))), shape=shape)


def boundary_of_triangles(
    n_nodes: int, links: Integers, triangles: Integers, weights: Array | None
) -> csr_array:
    """Return W^(-1/2) B_2, shape (N1, N2).

    The triangle (a, b, c) runs a to b to c to a. B_2 is +1 where a link points along it, else -1.
    """
    from scipy.sparse import csr_array

    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    rows, signs = find_links(n_nodes, links, sides)
    if weights is not None:
        if (weights[rows] == 0.0).any():
            index = int(np.argmax(weights[rows] == 0.0)) % len(triangles)
            raise BadInput(f"triangle {index} has a side of weight 0: its weights must be above 0")
        signs = signs / np.sqrt(weights[rows])
    columns = np.tile(np.arange(len(triangles)), 3)
    return csr_array((signs, (rows, columns)), shape=(len(links), len(triangles)))


def find_links(n_nodes: int, links: Integers, pairs: Integers) -> tuple[Integers, Array]:
    """Return the index of the link of each pair (n, 2), and its sign.

    The sign is +1 where the link points from the first node to the second. Every pair must have a
    link.
    """
    if not len(pairs):
        return np.empty(0, dtype=np.int64), np.empty(0)
    keys = pair_keys(n_nodes, links)
    rising = np.argsort(keys)
    found = rising[np.searchsorted(keys[rising], pair_keys(n_nodes, pairs))]
    return found, np.where(links[found, 0] == pairs[:, 0], 1.0, -1.0)


def cliques(n_nodes: int, links: Integers) -> Integers:
    """Return all triangles a < b < c whose sides are links, in rising order, shape (N2, 3)."""
    later: list[set[int]] = [set() for _ in range(n_nodes)]
    for a, b in np.sort(links, axis=1).tolist():
        later[a].add(b)
    found = [
        (a, b, c)
        for a, behind in enumerate(later)
        for b in sorted(behind)
        for c in sorted(behind & later[b])
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def adjacency(n_nodes: int, links: Integers, weights: Array | None, directed: bool) -> csr_array:
    """Return A, shape (N0, N0): A[head, tail] is the weight, and A[tail, head] unless directed."""
    from scipy.sparse import csr_array

    tail, head = links.T
    values = np.ones(len(links)) if weights is None else weights
    if not directed:
        tail, head = np.concatenate([tail, head]), np.concatenate([head, tail])
        values = np.tile(values, 2)
    return in_order(csr_array((values, (head, tail)), shape=(n_nodes, n_nodes)))


def mean_of_rows(matrix: csr_array) -> csr_array:
    """Return the matrix with each row divided by its sum. Raises BadInput for a sum of zero."""
    degree = np.asarray(matrix.sum(axis=1), dtype=np.float64)
    isolated = np.flatnonzero(degree == 0.0)
    if len(isolated):
        node = int(isolated[0])
        more = f" (and {len(isolated) - 1} more)" if len(isolated) > 1 else ""
        if matrix[[node]].nnz:
            fault = f"the weights of node {node}{more} add up to 0"
        elif matrix[:, [node]].nnz:
            fault = f"no link leads to node {node}{more}"
        else:
            fault = f"node {node}{more} has no links"
        raise BadInput(
            f"{fault}, and coupling is divided by the degree: link the node or leave it out"
        )
    mean = matrix.copy()
    mean.data /= np.repeat(degree, np.diff(mean.indptr))
    return mean


def in_order(matrix: csr_array) -> csr_array:
    """Return the matrix without stored zeros, the columns of each row in rising order."""
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def components(n_nodes: int, links: Integers) -> Integers:
    """Return the number of the connected component of each node, shape (N0,)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    ones = np.ones(len(links))
    adjacency = csr_array((ones, (links[:, 0], links[:, 1])), shape=(n_nodes, n_nodes))
    _, labels = connected_components(adjacency, directed=False)
    return np.asarray(labels, dtype=np.int64)


def pseudo_solve(laplacian: csr_array, w: Array) -> Array:
    """Return L^+ w, shape of w (N, ...): the solution of least norm of L x = w, w projected.

    Up to `MOST_DENSE` rows by eigenvalues, beyond by MINRES for each column.
    """
    if not w.size:
        return w.copy()
    columns = w.reshape(len(w), -1)
    if len(w) > MOST_DENSE:
        return np.column_stack([_minres(laplacian, c) for c in columns.T]).reshape(w.shape)
    values, vectors = np.linalg.eigh(laplacian.toarray())
    kept = values > 1e-10 * max(1.0, float(values.max(initial=0.0)))
    basis = vectors[:, kept]
    solved: Array = (basis / values[kept]) @ (basis.T @ columns)
    return solved.reshape(w.shape)


def _minres(laplacian: csr_array, column: Array) -> Array:
    from scipy.sparse.linalg import minres

    solution, _ = minres(laplacian, column, rtol=1e-14, maxiter=20 * len(column))
    return np.asarray(solution)


def rank(matrix: csr_array) -> int:
    """Return the rank of a boundary matrix, by singular values."""
    return int(np.linalg.matrix_rank(matrix.toarray())) if min(matrix.shape) else 0


def ring_links(n_nodes: int, half_degree: int) -> Integers:
    """Return the links i to i + k (mod N0), k = 1..P, of a ring, shape (N0 P, 2)."""
    tail = np.repeat(np.arange(n_nodes), half_degree)
    head = (tail + np.tile(np.arange(1, half_degree + 1), n_nodes)) % n_nodes
    links: NDArray[np.int64] = np.column_stack([tail, head])
    return links
