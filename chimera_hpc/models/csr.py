"""Sparse matrices (CSR) among the integers that all lanes of a kernel call share.

A matrix is stored once for all lanes, as int64: where each row starts, the column of each entry,
and the bits of each value, which is a float64. In a complete graph, or between two populations,
many rows are equal off the diagonal. Such rows are stored once, ``M = Z T + diag(d)``, where Z
picks the row of T of each row of M: L_0 u of a complete graph is ``N u - sum(u)``.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.network.network import Network

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Which: TypeAlias = Literal["adjacency", "differences", "mean", "laplacian", "dirac"]

DENSE = 0.2
"""Part of all entries from which on equal rows are looked for."""
MOST_VALUES = 8
"""Most different values of a matrix whose equal rows are looked for."""


@dataclass(frozen=True, eq=False)
class Packed:
    """One or two matrices for a kernel (`csr_kernels.matrix_at`).

    ``integers`` is what the kernel gets, ``key`` tells it apart from other ones, ``n_shared`` is
    the number of rows of T of the first matrix, 0 if its rows are stored one by one.
    """

    integers: Integers
    key: bytes
    n_shared: int
    n_entries: int

    @property
    def kernel(self) -> str:
        """How a product is computed, in words."""
        rows = f"{self.n_shared} shared rows" if self.n_shared else "sparse rows"
        return f"{rows}, {self.n_entries} entries"


@lru_cache(maxsize=32)
def packed(network: Network, which: Which, k: int = 0) -> Packed:
    """Return a matrix of a network, packed once.

    "adjacency": A; "differences": A - diag(A 1); "mean": A over the degree, minus the identity;
    "laplacian": L_k; "dirac": D = [B_k^T, B_(k+1)] and its transpose, and the columns of B_k^T.

    Raises
    ------
    BadInput
        As the matrices of `Network` do.
    """
    from scipy.sparse import csr_array, diags_array, eye_array

    if which == "dirac":
        dirac = network.dirac(k)
        lower = network.boundary(k).shape[0] if k > 0 else 0
        return pack(dirac, csr_array(dirac.T), share=False, numbers=(lower,))
    if which == "laplacian":
        return pack(network.laplacian(k))
    if which == "adjacency":
        return pack(network.adjacency)
    if which == "mean":
        return pack(csr_array(network.neighbour_mean - eye_array(network.n_nodes)))
    degree = np.asarray(network.adjacency.sum(axis=1))
    return pack(csr_array(network.adjacency - diags_array(degree)))


def pack(*matrices: csr_array, share: bool = True, numbers: tuple[int, ...] = ()) -> Packed:
    """Return matrices as integers: a header of six for each, ``numbers``, then the parts.

    The header is: rows of M, rows of T (0: none shared), offsets of starts, columns, values, and
    of the rows' labels, which the diagonal follows. Entries of a row are in the order of columns.
    """
    found = [_split(matrix, share) for matrix in matrices]
    header: list[int] = []
    parts: list[Integers] = []
    at = 6 * len(found) + len(numbers)
    for labels, table, diagonal in found:
        block = [_ints(table.indptr), _ints(table.indices), _bits(table.data)]
        block += [_ints(labels), _bits(diagonal)]
        offsets = at + np.cumsum([0, *map(len, block)])
        shared = table.shape[0] if len(labels) else 0
        header += [len(labels) or table.shape[0], shared, *offsets[:4].tolist()]
        parts += block
        at = int(offsets[-1])
    integers = np.concatenate([np.array([*header, *numbers], dtype=np.int64), *parts])
    key = hashlib.blake2b(integers.tobytes(), digest_size=16).digest()
    return Packed(integers, key, header[1], sum(table.nnz for _, table, _ in found))


def _ints(values: NDArray[np.integer]) -> Integers:
    return np.asarray(values, dtype=np.int64)


def _bits(values: Array) -> Integers:
    return np.ascontiguousarray(values, dtype=np.float64).view(np.int64)


def _split(matrix: csr_array, share: bool) -> tuple[Integers, csr_array, Array]:
    """Return (labels, T, d) with M = T[labels] + diag(d); without labels, M is T."""
    ordered = matrix.copy()
    ordered.sum_duplicates()
    found = _shared_rows(ordered) if share else None
    return found or (np.empty(0, dtype=np.int64), ordered, np.empty(0))


def _shared_rows(matrix: csr_array) -> tuple[Integers, csr_array, Array] | None:
    from scipy.sparse import csr_array, diags_array

    n = matrix.shape[0]
    diagonal: Array = matrix.diagonal()
    if matrix.shape[1] != n or matrix.nnz < DENSE * n * n:
        return None
    off = csr_array(matrix - diags_array(diagonal))
    off.eliminate_zeros()
    values = np.unique(off.data)
    if len(values) > MOST_VALUES:
        return None
    labels, own = _classes(off, values)
    first = np.unique(labels, return_index=True)[1]
    if 2 * len(first) > n:
        return None
    among = csr_array((own[first], (np.arange(len(first)), first)), shape=(len(first), n))
    table = csr_array(off[first] + among)
    left = csr_array(off - table[labels])
    left.eliminate_zeros()
    if left.nnz != np.count_nonzero(left.diagonal()):
        return None
    return labels, table, diagonal - own


def _classes(off: csr_array, values: Array) -> tuple[Integers, Array]:
    """Return the class of each row, and the value that links its rows with each other.

    Rows i and j that are linked by a and equal in all other columns have equal
    ``off @ r + a r`` for a random r. Each row is in the largest class that this finds.
    """
    n = off.shape[0]
    labels, own, size = np.arange(n), np.zeros(n), np.ones(n)
    r = np.random.default_rng(0).uniform(1.0, 2.0, n)
    product = off @ r
    for number, a in enumerate((0.0, *values), start=1):
        key = product + a * r
        order = np.argsort(key, kind="stable")
        new = np.diff(key[order], prepend=-np.inf) > 1e-12 * np.abs(key).max()
        group = np.empty(n, dtype=np.int64)
        group[order] = np.cumsum(new) - 1
        members = np.bincount(group)[group]
        larger = members > size
        labels[larger], own[larger], size[larger] = (number * n + group)[larger], a, members[larger]
    return np.unique(labels, return_inverse=True)[1], own
