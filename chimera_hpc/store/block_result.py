"""The results of a block of points, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.job import Points, Sweep
from chimera_hpc.store.schema import FEATURES, MISSING, QUALITY, scalar_labels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BlockResult:
    """The results of a block of n points; rows in the order of the points.

    A point that was not reached (the caller stopped) has status NEVER and is not written.

    status (n,): `Status` of each point.
    features (n, 8, N0): along axis 1 `schema.FEATURES`; NaN unless the point is DONE.
    scalars (n, n_scalars): along axis 1 `schema.scalar_labels`; like the features, of u as it is
        stored (`rounded`).
    quality (n, 2): along axis 1 `schema.QUALITY`; NaN unless the point is DONE.
    steps, elapsed_us, n_windows (n,): accepted steps, share of the wall time in microseconds,
        Fourier windows.
    state (n, variables): with [continue] the last state, u then v, from which the next point of the
        chain starts; NaN unless the point has a result, and beyond its variables.
    series (n, T, N0): u on the analysis interval as it is stored; None when the sweep keeps none.
    """

    status: NDArray[np.int64]
    features: Array
    scalars: Array
    quality: Array
    steps: NDArray[np.int64]
    elapsed_us: NDArray[np.int64]
    n_windows: NDArray[np.int64]
    series: NDArray[Any] | None
    state: Array | None = None


def failed_block(sweep: Sweep, points: Points, status: Status, n_state: int = 0) -> BlockResult:
    """Return the result of points that could not be computed at all, for the reason ``status``."""
    result = empty_result(sweep, len(points), n_state)
    result.status[:] = status
    return result


def joined(results: Sequence[BlockResult]) -> BlockResult:
    """Return the results of several lists of points as one."""
    columns: dict[str, Any] = {}
    for name in (field.name for field in fields(BlockResult)):
        parts = [getattr(result, name) for result in results]
        columns[name] = None if parts[0] is None else np.concatenate(parts)
    return BlockResult(**columns)


def empty_result(sweep: Sweep, n: int, n_state: int = 0) -> BlockResult:
    """Return the result of n points none of which was reached.

    n_state: values of a state, with [continue].
    """
    series = None
    if sweep.keep.series != "none":
        missing = MISSING if sweep.keep.dtype == "int16" else np.nan
        shape = (n, sweep.n_samples, sweep.n_observed)
        series = np.full(shape, missing, dtype=sweep.keep.dtype)
    return BlockResult(
        status=np.full(n, int(Status.NEVER), dtype=np.int64),
        features=np.full((n, len(FEATURES), sweep.n_observed), np.nan),
        scalars=np.full((n, len(scalar_labels(sweep))), np.nan),
        quality=np.full((n, len(QUALITY)), np.nan),
        steps=np.zeros(n, dtype=np.int64),
        elapsed_us=np.zeros(n, dtype=np.int64),
        n_windows=np.zeros(n, dtype=np.int64),
        series=series,
        state=None if sweep.continue_ is None else np.full((n, n_state), np.nan),
    )
