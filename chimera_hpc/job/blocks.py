"""Blocks of points: the unit in which points are claimed, computed and written."""

from __future__ import annotations

from chimera_hpc.job.chains import chain_length
from chimera_hpc.job.spec import Sweep

SHARD_BYTES = 32 * 10**6
"""Most bytes of series in one block, which is one shard of the store."""
BLOCK_SECONDS = 10.0
"""Target for the work in one block: long enough for a scheduler, short if a worker is lost."""
LEAST_BLOCKS = 8
"""Least number of blocks of a sweep with enough points. It keeps a few workers busy."""

_NODE_TIME_SECONDS = 2.5e-6
"""Work per node and unit of time at rtol 1e-3: 50 steps of Tsit5, 50 ns each, with features."""
_SERIES_BYTES = {"int16": 2, "float32": 4}


def block_size(sweep: Sweep, n_points: int) -> int:
    """Return the points per block: run.block, or a number chosen from the cost of the sweep.

    The number is chosen so that the block's series fit in one shard, its work takes about
    `BLOCK_SECONDS`, and the sweep has at least `LEAST_BLOCKS` blocks. With [continue], a block is a
    chain.
    """
    if sweep.continue_ is not None:
        return chain_length(sweep)
    by_shard = SHARD_BYTES / max(1.0, series_bytes(sweep))
    by_work = BLOCK_SECONDS / point_seconds(sweep)
    size = sweep.run.block or min(by_shard, by_work, -(-n_points // LEAST_BLOCKS))
    return max(1, min(int(size), n_points))


def point_seconds(sweep: Sweep) -> float:
    """Return a rough estimate of the work of one point, in seconds on one core.

    The steps of a method of order 5 scale as rtol^(-1/5). The full form has N0 (1 + P) variables
    instead of 2 N0; the estimate assumes P = N0 / 4, the middle of the range of P.
    """
    tolerance: float = max(1.0, (1e-3 / sweep.integrator.rtol) ** 0.2)
    variables = (1 + sweep.n_observed / 4) / 2 if sweep.integrator.form == "full" else 1.0
    settle = 0.0 if sweep.continue_ is None else sweep.continue_.settle
    nodes_time = sweep.n_observed * (settle + sweep.integrator.t_end)
    return _NODE_TIME_SECONDS * nodes_time * tolerance * variables


def series_bytes(sweep: Sweep) -> float:
    """Return the bytes of series that the store keeps per point, averaged over the seeds."""
    share = {"all": 1.0, "none": 0.0, "first-seed": 1 / len(sweep.seeds)}
    n_bytes = sweep.n_samples * sweep.n_observed * _SERIES_BYTES[sweep.keep.dtype]
    return share[sweep.keep.series] * n_bytes


def blocks(n_points: int, size: int) -> list[tuple[int, int]]:
    """Return (start, stop) of each block. All have `size` points, except the last."""
    return [(start, min(start + size, n_points)) for start in range(0, n_points, size)]
