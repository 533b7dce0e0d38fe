"""Sparse matrices (CSR) among the integers that all lanes of a kernel call share.

A matrix is stored once for all lanes, as int64: where each row starts, the column of each entry,
and the bits of each value, which is a float64. Two kinds of matrices need less:

- Equal values in each row off the diagonal, as for all networks without weights: a factor for each
  row and the diagonal, ``M = diag(r) (0 or 1) + diag(d)``, so that a row is a plain sum.
- Rows that are equal off the diagonal, as in a complete graph or between two populations: each is
  stored once, ``M = Z T + diag(d)``, where Z picks the row of T of each row of M. L_0 u of a
  complete graph is ``N u - sum(u)``.
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
        return pack(dirac, csr_array(dirac.T), share=False, split=lower)
    if which == "laplacian":
        return pack(network.laplacian(k))
    if which == "adjacency":
        return pack(network.adjacency)
    if which == "mean":
        return pack(csr_array(network.neighbour_mean - eye_array(network.n_nodes)))
    degree = np.asarray(network.adjacency.sum(axis=1))
    return pack(csr_array(network.adjacency - diags_array(degree)))


def pack(*matrices: csr_array, share: bool = True, split: int = 0) -> Packed:
    """Return matrices as integers: a header of eight for each, ``split``, then the parts.

    The header is: rows of M, rows of T (0: none shared), and the offsets of the order in which rows
    are stored, their starts, columns, values (0: equal in each row), of what belongs to each row
    (the label of a shared one, or the factor of equal values, then the diagonal), and of the runs.
    Rows are in order of their lengths, so that processors predict the ends of the sums; entries of
    a row are in the order of columns. Rows before ``split`` stay before the others. A run is some
    rows of one length: there is their number, then the length of each and the row at its end.
    """
    found = [_parts(matrix, share, split) for matrix in matrices]
    header: list[int] = []
    at = 8 * len(found) + 1
    for rows, shared, parts in found:
        offsets = at + np.cumsum([0, *map(len, parts)])
        uniform = len(parts) > 5 and not len(parts[3])
        values = 0 if uniform else int(offsets[3])
        header += [rows, shared, *offsets[:3].tolist(), values, int(offsets[4]), int(offsets[-2])]
        at = int(offsets[-1])
    blocks = [part for _, _, parts in found for part in parts]
    integers = np.concatenate([np.array([*header, split], dtype=np.int64), *blocks])
    key = hashlib.blake2b(integers.tobytes(), digest_size=16).digest()
    return Packed(integers, key, header[1], sum(len(parts[2]) for _, _, parts in found))


Parts: TypeAlias = tuple[int, int, list[Integers]]
"""Rows of M, rows of T, and the blocks: order, starts, columns, values, labels or factors and
diagonal, runs."""


def _parts(matrix: csr_array, share: bool, split: int) -> Parts:
    rows, shared, parts = _blocks(matrix, share, split)
    return rows, shared, [*parts, _runs(parts[1])]


def _runs(starts: Integers) -> Integers:
    lengths = np.diff(starts)
    last = np.flatnonzero(np.diff(lengths, append=-1))
    pairs = np.stack([lengths[last], last + 1], axis=1)
    return _ints(np.array([len(last), *pairs.ravel()]))


def _blocks(matrix: csr_array, share: bool, split: int) -> Parts:
    ordered = matrix.copy()
    ordered.sum_duplicates()
    n = ordered.shape[0]
    if share and (found := _shared_rows(ordered)):
        labels, table, diagonal = found
        each = [_bits(table.data), _ints(labels), _bits(diagonal)]
        return (
            n,
            table.shape[0],
            [_ints(np.arange(n)), _ints(table.indptr), _ints(table.indices), *each],
        )
    order = np.lexsort((np.diff(ordered.indptr), np.arange(n) >= split))
    if share and (uniform := _uniform_rows(ordered)):
        factors, table, diagonal = uniform
        sorted_rows = table[order]
        each = [np.empty(0, dtype=np.int64), _bits(factors[order]), _bits(diagonal[order])]
    else:
        sorted_rows = ordered[order]
        each = [_bits(sorted_rows.data)]
    return n, 0, [_ints(order), _ints(sorted_rows.indptr), _ints(sorted_rows.indices), *each]


def _ints(values: NDArray[np.integer]) -> Integers:
    return np.asarray(values, dtype=np.int64)


def _bits(values: Array) -> Integers:
    return np.ascontiguousarray(values, dtype=np.float64).view(np.int64)


def _uniform_rows(matrix: csr_array) -> tuple[Array, csr_array, Array] | None:
    """Return (r, T, d) with M = diag(r) T + diag(d), T without diagonal and of ones; or None."""
    if matrix.shape[1] != matrix.shape[0]:
        return None
    off, diagonal = _without_diagonal(matrix)
    if not off.nnz:
        return None
    row = np.repeat(np.arange(off.shape[0]), np.diff(off.indptr))
    factors = np.zeros(off.shape[0])
    factors[row] = off.data
    return (factors, off, diagonal) if np.array_equal(factors[row], off.data) else None


def _without_diagonal(matrix: csr_array) -> tuple[csr_array, Array]:
    from scipy.sparse import csr_array, diags_array

    diagonal: Array = matrix.diagonal()
    off = csr_array(matrix - diags_array(diagonal))
    off.eliminate_zeros()
    return off, diagonal


def _shared_rows(matrix: csr_array) -> tuple[Integers, csr_array, Array] | None:
    """Return (labels, T, d) with M = T[labels] + diag(d) and few rows of T, or None."""
    from scipy.sparse import csr_array

    n = matrix.shape[0]
    if matrix.shape[1] != n or matrix.nnz < DENSE * n * n:
        return None
    off, diagonal = _without_diagonal(matrix)
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
