"""How the points of a sweep are cut into blocks: the unit of work, of ownership and of writing."""

from __future__ import annotations

from chimera_hpc.job.spec import Sweep

SHARD_BYTES = 32 * 10**6
"""Most bytes of series in one block: they are one shard of the store."""
BLOCK_SECONDS = 10.0
"""Work aimed at in one block: long for a scheduler, short for what a lost worker costs."""
LEAST_BLOCKS = 8
"""Blocks that a sweep has at least, if it has the points: they keep a few workers busy."""

_NODE_TIME_SECONDS = 2.5e-6
"""Work a node and unit of time at rtol 1e-3: Tsit5 takes 50 steps of 50 ns, features included."""
_SERIES_BYTES = {"int16": 2, "float32": 4}


def block_size(sweep: Sweep, n_points: int) -> int:
    """Return the points a block: run.block, or a number chosen from the cost of the sweep.

    Chosen so that the block's series fit one shard, its work is about `BLOCK_SECONDS`, and there
    are at least `LEAST_BLOCKS` of them.
    """
    by_shard = SHARD_BYTES / max(1.0, series_bytes(sweep))
    by_work = BLOCK_SECONDS / point_seconds(sweep)
    size = sweep.run.block or min(by_shard, by_work, -(-n_points // LEAST_BLOCKS))
    return max(1, min(int(size), n_points))


def point_seconds(sweep: Sweep) -> float:
    """Return a rough estimate of the work of one point, in seconds on one core.

    Steps of a method of order 5 grow as rtol^(-1/5); the full form has N0 (1 + P) variables instead
    of 2 N0, taken at P = N0 / 4, the middle of what P may be.
    """
    tolerance: float = max(1.0, (1e-3 / sweep.integrator.rtol) ** 0.2)
    variables = (1 + sweep.n_nodes / 4) / 2 if sweep.integrator.form == "full" else 1.0
    nodes_time = sweep.n_nodes * sweep.integrator.t_end
    return _NODE_TIME_SECONDS * nodes_time * tolerance * variables


def series_bytes(sweep: Sweep) -> float:
    """Return the bytes of series that the store keeps a point, in the mean over the seeds."""
    share = {"all": 1.0, "none": 0.0, "first-seed": 1 / len(sweep.seeds)}
    n_bytes = sweep.n_samples * sweep.n_nodes * _SERIES_BYTES[sweep.keep.dtype]
    return share[sweep.keep.series] * n_bytes


def blocks(n_points: int, size: int) -> list[tuple[int, int]]:
    """Return (start, stop) of each block: consecutive, of `size` points but for the last one."""
    return [(start, min(start + size, n_points)) for start in range(0, n_points, size)]
