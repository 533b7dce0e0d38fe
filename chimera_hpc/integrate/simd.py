"""SIMD vectors: `LANES` float64 that one instruction works on.

A kernel is written once, over numbers. Called with a ``float`` it works on one trajectory; called
with a vector it works on `LANES` of them, lane by lane, with the same IEEE operations in the same
order. That is why a trajectory has the same bits whatever its lane and its neighbours.

Arrays are (rows, lanes), C-contiguous. ``load(like, array, row)`` reads row ``row`` as the kind of
number that ``like`` is; ``store(array, row, value)`` writes it. A single trajectory has its rows
one after the other in memory. There a vector is eight neighbouring rows, which `load_at`,
`load_some` and their partners address by offset. Sums over rows go to eight partial sums (`fold`)
or through three levels (`SCAN`): an order that vectors of lanes and vectors of rows can share.

With ``NUMBA_DISABLE_JIT=1`` a vector is a NumPy array of `LANES` numbers (`simd_numpy`), otherwise
it is an LLVM vector (`simd_llvm`). The two modules have the same functions.
"""

import numba

from chimera_hpc.integrate.simd_constants import LANES, SCAN

if numba.config.DISABLE_JIT:
    from chimera_hpc.integrate import simd_numpy as _simd
else:
    from chimera_hpc.integrate import simd_llvm as _simd

__all__ = ["LANES", "SCAN"]

across = _simd.across
add_shifted = _simd.add_shifted
broadcast = _simd.broadcast
fma = _simd.fma
fold = _simd.fold
larger = _simd.larger
last_of = _simd.last_of
load = _simd.load
load_at = _simd.load_at
load_some = _simd.load_some
magnitude = _simd.magnitude
prefetch = _simd.prefetch
store = _simd.store
store_at = _simd.store_at
store_some = _simd.store_some
stream_at = _simd.stream_at
transposed = _simd.transposed
