"""SIMD vectors: `LANES` float64 that one instruction processes.

A kernel is written once, for numbers. Called with a ``float``, it computes one trajectory. Called
with a vector, it computes `LANES` of them, lane by lane, with the same IEEE operations in the same
order. The bits of a trajectory therefore do not depend on its lane or on the other lanes.

Arrays are (rows, lanes), C-contiguous. ``load(like, array, row)`` reads row ``row`` as the type of
``like``; ``store(array, row, value)`` writes it. The rows of a single trajectory are contiguous in
memory. A vector is then eight neighbouring rows, which `load_at`, `load_some` and the matching
stores address by offset. Sums over rows use eight partial sums (`fold`) or three levels (`SCAN`),
so vectors of lanes and vectors of rows add in the same order.

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
integer_at = _simd.integer_at
larger = _simd.larger
last_of = _simd.last_of
load = _simd.load
load_at = _simd.load_at
load_some = _simd.load_some
magnitude = _simd.magnitude
real_at = _simd.real_at
store = _simd.store
store_at = _simd.store_at
store_some = _simd.store_some
stream_at = _simd.stream_at
transposed = _simd.transposed
