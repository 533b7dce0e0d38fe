"""What estimators take for X: runs as pairs, as an array, or as a dataset."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput

_NODES = ("node", "link", "triangle")
"""Dimensions along which a run has signals."""


class SignalRun(NamedTuple):
    """Times t (T,), signals u (T, N), and w (T, N), the second component, where it is known."""

    t: NDArray[np.float64]
    u: NDArray[np.float64]
    w: NDArray[np.float64] | None = None


def signal_runs(X: Any, step: float = 1.0) -> Iterator[SignalRun]:
    """Yield the runs of X one by one.

    X : list of (t, u) or (t, u, w), or of objects with these attributes; an array (runs, times,
        nodes), or a list of arrays (times, nodes), sampled every `step`; or an xarray.Dataset with
        u(point, time, node), as `chimera_hpc.open` gives.

    Raises BadInput for anything else.
    """
    if hasattr(X, "data_vars"):
        yield from _of_dataset(X)
        return
    if isinstance(X, np.ndarray) and X.ndim != 3:
        raise BadInput(f"an array of runs has the shape (runs, times, nodes), not {X.shape}")
    if not hasattr(X, "__len__"):
        raise BadInput(f"runs are a list, an array or a dataset, not {type(X).__name__}")
    for number, run in enumerate(X):
        yield _run_of(run, number, step)


def _run_of(run: Any, number: int, step: float) -> SignalRun:
    if hasattr(run, "t") and hasattr(run, "u"):
        return SignalRun(run.t, run.u, getattr(run, "w", None))
    if isinstance(run, np.ndarray) and run.ndim == 2:
        return SignalRun(step * np.arange(len(run), dtype=np.float64), run)
    if isinstance(run, tuple | list) and len(run) in (2, 3):
        return SignalRun(*run)
    raise BadInput(f"run {number} is neither (t, u) nor an array (times, nodes)")


def _of_dataset(data: Any) -> Iterator[SignalRun]:
    missing = {"u", "time"} - {*map(str, data.variables)}
    if missing:
        raise BadInput(f"the dataset has no {', '.join(sorted(missing))}")
    u = data["u"]
    others = [dim for dim in u.dims if dim != "time"]
    if "time" not in u.dims or len(others) < 2:
        known = ", ".join(map(str, u.dims))
        raise BadInput(f"u has the dimensions {known}; runs, time and nodes are needed")
    node = next((name for name in _NODES if name in others), others[-1])
    runs = [dim for dim in others if dim != node]
    stacked = u.stack(run=runs) if len(runs) != 1 else u.rename({runs[0]: "run"})
    t = np.asarray(data["time"].values, dtype=np.float64)
    for number in range(stacked.sizes["run"]):
        one = stacked.isel(run=number).transpose("time", node)
        yield SignalRun(t, np.asarray(one.values, dtype=np.float64))
