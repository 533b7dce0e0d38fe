"""Neighbours of each node, for measures that compare a node with those around it."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput

Integers = NDArray[np.int64]


class NeighbourTable(NamedTuple):
    """Node i has the neighbours ``indices[indptr[i] : indptr[i + 1]]``."""

    indptr: Integers
    """(N + 1,)"""
    indices: Integers
    """(2 n,) for n pairs"""

    @property
    def degrees(self) -> Integers:
        """Number of neighbours of each node, (N,)."""
        return np.diff(self.indptr)


def neighbours(pairs: str | ArrayLike, n_nodes: int) -> NeighbourTable:
    """Return the neighbours of N nodes.

    Parameters
    ----------
    pairs : "ring", or array_like of int, shape (n, 2)
        "ring" joins i and i + 1, and the last node with the first. Otherwise the two nodes, from
        0, of each pair, in any order; a pair that is given twice counts once.
    n_nodes : int
        N.

    Raises
    ------
    BadInput
        Another word, a wrong shape, a node outside 0 .. N-1, or a pair of a node with itself.
    """
    if isinstance(pairs, str) and pairs == "ring":
        return _ring(n_nodes)
    joined = _given(pairs)
    outside = (joined < 0) | (joined >= n_nodes)
    if outside.any():
        raise BadInput(f"pairs: node {joined[outside][0]}: allowed is 0 to {n_nodes - 1}")
    return _table(joined, n_nodes)


def _table(joined: Integers, n_nodes: int) -> NeighbourTable:
    joined = np.unique(np.sort(joined, axis=1), axis=0)
    both = np.concatenate([joined, joined[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    counts = np.bincount(both[:, 0], minlength=n_nodes)
    return NeighbourTable(
        np.concatenate([[0], np.cumsum(counts)]), np.ascontiguousarray(both[:, 1])
    )


# Every run of a sweep asks for it.
@lru_cache(maxsize=8)
def _ring(n_nodes: int) -> NeighbourTable:
    i = np.arange(n_nodes if n_nodes > 1 else 0)
    return _table(np.stack([i, (i + 1) % n_nodes], axis=1), n_nodes)


def _given(pairs: str | ArrayLike) -> Integers:
    joined = np.asarray(pairs)
    if joined.ndim != 2 or joined.shape[1] != 2 or joined.dtype.kind not in "iu":
        what = repr(pairs) if isinstance(pairs, str) else f"{joined.dtype} {joined.shape}"
        raise BadInput(f'pairs must be "ring" or nodes as integers of shape (n, 2), not {what}')
    same = joined[:, 0] == joined[:, 1]
    if same.any():
        raise BadInput(f"pairs: node {joined[same][0, 0]} is paired with itself")
    return joined.astype(np.int64)
