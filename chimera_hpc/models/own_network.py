"""The network of a user's model: its links as CSR arrays, for the right-hand side."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import compile_uncached
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.network.network import Network

Integers = NDArray[np.int64]
_types: Any = types  # numba's annotations leave its named tuples out


class Neighbours(NamedTuple):
    """Links of all nodes: node i has ``indices[e]`` with ``weights[e]``, e in its range.

    The range of node i is ``indptr[i] ... indptr[i + 1] - 1``, in rising order of the neighbours. A
    link appears at both of its ends; that of a directed network at its head, whose neighbour is the
    tail. Without weights they are 1.
    """

    indptr: Any
    indices: Any
    weights: Any


def compile_with_network(function: Callable[..., Any]) -> Any:
    """Compile ``function(y, dy, p, ints, network)``, with `Neighbours`, as a right-hand side."""
    integers = RIGHT_HAND_SIDE.args[3]
    reals = types.Array(types.float64, 1, "C")
    network = _types.NamedTuple((integers, integers, reals), Neighbours)
    inner = compile_uncached(types.void(*RIGHT_HAND_SIDE.args, network), function)

    def right_hand_side(y: Any, dy: Any, p: Any, numbers: Any) -> None:
        own = 1 + numbers[0]
        ints = numbers[1:own]
        columns = own + ints[0] + 1
        indptr = numbers[own:columns]
        values = columns + indptr[ints[0]]
        weights = numbers[values:].view(np.float64)
        inner(y, dy, p, ints, Neighbours(indptr, numbers[columns:values], weights))

    return compile_uncached(RIGHT_HAND_SIDE, right_hand_side)


@lru_cache(maxsize=32)
def with_network(ints: tuple[int, ...], network: Network) -> Integers:
    """Return what lanes share: how many ``ints``, these, and the arrays of `Neighbours`."""
    matrix = network.adjacency
    values = np.ascontiguousarray(matrix.data, dtype=np.float64).view(np.int64)
    parts = [[len(ints)], ints, matrix.indptr, matrix.indices, values]
    return np.concatenate([np.asarray(part, dtype=np.int64) for part in parts])
