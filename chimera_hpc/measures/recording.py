"""The checked input of the Fourier method: a recording, and the options of its windows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array, floats, integer, node_rows

# Largest distance of a time from the uniform grid, in steps.
_UNIFORM = 1e-2


@dataclass(frozen=True)
class Recording:
    """Checked input: N signals in rows (N, T), sampled at t[0] + dt * (0 .. T-1)."""

    t: Array
    dt: float
    x: Array


def recording(t: ArrayLike, u: ArrayLike) -> Recording:
    """Return times (T,) and signals (T, N), checked; BadInput as in `fourier_features`."""
    times, rows = floats("t", t), node_rows("u", u)
    n_times = rows.shape[1]
    if times.shape != (n_times,):
        turned = times.shape == (len(rows),)
        hint = f"; u is {rows.T.shape}: are its axes swapped? pass u.T" if turned else ""
        raise BadInput(
            f"t must have shape ({n_times},), one time a row of u, not {times.shape}{hint}"
        )
    if n_times < 3:
        raise BadInput(f"t must hold at least 3 times, not {n_times}")
    dt = float(times[-1] - times[0]) / (n_times - 1)
    if not (math.isfinite(dt) and dt > 0):
        raise BadInput(f"t must be finite and rise, from t[0] = {times[0]} to t[-1] = {times[-1]}")
    departure = np.abs(times - (times[0] + dt * np.arange(n_times))).max() / dt
    if not departure <= _UNIFORM:
        raise BadInput(
            f"t must be uniform: a time is {departure:.3g} steps off, allowed is {_UNIFORM:g}"
        )
    return Recording(times, dt, rows)


def check_windows(n_peaks: int, n_overlap: int) -> tuple[int, int]:
    """Return maxima per window and shared maxima as integers; BadInput if they make no windows."""
    n_peaks, n_overlap = integer("n_peaks", n_peaks), integer("n_overlap", n_overlap)
    if n_peaks < 3:
        raise BadInput(f"n_peaks must be at least 3, not {n_peaks}")
    if not 0 <= n_overlap < n_peaks:
        raise BadInput(f"n_overlap must be in 0 .. n_peaks - 1 = {n_peaks - 1}, not {n_overlap}")
    return n_peaks, n_overlap


def check_node(reference_node: int, n_nodes: int) -> int:
    """Return the node as int; BadInput if there is no such column."""
    reference_node = integer("reference_node", reference_node)
    if not 0 <= reference_node < n_nodes:
        raise BadInput(f"reference_node must be in 0 .. {n_nodes - 1}, not {reference_node}")
    return reference_node


def check_threshold(threshold: float) -> None:
    """Raise BadInput unless the threshold is finite and not negative."""
    if not 0.0 <= threshold < math.inf:
        raise BadInput(f"steady_threshold must be a finite number >= 0, not {threshold}")
