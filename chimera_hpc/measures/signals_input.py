"""The checked input of the Fourier method: a recording, and the options of its windows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array, floats, integer, node_rows
from chimera_hpc.measures.windows import hidden_windows

# Largest distance of a time from the uniform grid, in steps.
_UNIFORM = 1e-2
# Ratio of the mean squares of steps along the two axes above which the axes may be swapped.
_SMOOTHER = 4.0
# Standard deviation over root mean square of u above which a steady run may be an oscillation.
_SMALL = 1e-2
_MOST_NAMED = 5
# Least number of samples for which a signal that only rises or falls is suspicious.
_FEWEST = 20


@dataclass(frozen=True)
class CheckedSignals:
    """Checked input: N signals in rows (N, T), sampled at t[0] + dt * (0 .. T-1)."""

    t: Array
    dt: float
    x: Array


def checked_signals(t: ArrayLike, u: ArrayLike) -> CheckedSignals:
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
    return CheckedSignals(times, dt, rows)


def suspect_signals(x: Array) -> list[str]:
    """Return a line, with advice, for each sign that x (N, T) may not hold the signals meant."""
    steps = np.diff(x, axis=1)
    constant = (steps == 0.0).all(axis=1)
    one_way = ((steps >= 0.0).all(axis=1) | (steps <= 0.0).all(axis=1)) & ~constant
    lines = []
    if constant.any() and not constant.all():
        what = "never changes: its amplitude, frequency and phase count as 0"
        lines.append(f"{_columns(constant)} {what}; leave it out if it is no oscillator")
    if one_way.any() and x.shape[1] >= _FEWEST:
        what = "rises or falls throughout: a time, a counter or a phase?"
        lines.append(f"{_columns(one_way)} {what} Leave it out, or pass its sine")
    along = float(np.mean(np.square(steps)))
    across = float(np.mean(np.square(np.diff(x, axis=0)))) if len(x) > 1 else math.inf
    if len(x) >= x.shape[1] and across < along / _SMOOTHER:
        lines.append(
            f"u has {x.shape[1]} times of {len(x)} nodes and is smoother along the nodes: are its "
            "axes swapped? Pass u.T"
        )
    return lines


def suspect_steadiness(x: Array, deviation: float, threshold: float) -> list[str]:
    """Return a line if an absolute threshold made signals x (N, T) steady that vary much."""
    if deviation < _SMALL * float(np.sqrt(np.mean(np.square(x)))) or deviation == 0.0:
        return []
    return [
        f"steady: u varies by {deviation:.3g} (mean standard deviation), less than "
        f"steady_threshold = {threshold:g}, which has the unit of u; if it oscillates, pass "
        f"steady_threshold={0.01 * deviation:.0e}"
    ]


def suspect_prominence(x: Array, n_peaks: int, prominence: float) -> list[str]:
    """Return a line if an absolute limit left signals x (N, T) without a window."""
    hidden = hidden_windows(x, n_peaks, prominence)
    if not hidden.any():
        return []
    return [
        f"{_columns(hidden)} has fewer than n_peaks = {n_peaks} maxima of prominence = "
        f"{prominence:g}, which has the unit of u; pass a smaller prominence, 0 for all maxima"
    ]


def _columns(which: NDArray[np.bool_]) -> str:
    numbers = [str(i) for i in np.flatnonzero(which)[:_MOST_NAMED]]
    more = ", ..." if np.count_nonzero(which) > _MOST_NAMED else ""
    return f"column {', '.join(numbers)}{more} of u"


def check_windows(n_peaks: int, n_overlap: int, max_windows: int) -> tuple[int, int, int]:
    """Return the settings of windows as integers; BadInput if they make no windows."""
    n_peaks, n_overlap = integer("n_peaks", n_peaks), integer("n_overlap", n_overlap)
    if n_peaks < 3:
        raise BadInput(f"n_peaks must be at least 3, not {n_peaks}")
    if not 0 <= n_overlap < n_peaks:
        raise BadInput(f"n_overlap must be in 0 .. n_peaks - 1 = {n_peaks - 1}, not {n_overlap}")
    max_windows = integer("max_windows", max_windows)
    if max_windows < 0:
        raise BadInput(f"max_windows must be at least 1, or 0 for all windows, not {max_windows}")
    return n_peaks, n_overlap, max_windows


def check_node(reference_node: int, n_nodes: int) -> int:
    """Return the node as int; BadInput if there is no such column."""
    reference_node = integer("reference_node", reference_node)
    if not 0 <= reference_node < n_nodes:
        raise BadInput(f"reference_node must be in 0 .. {n_nodes - 1}, not {reference_node}")
    return reference_node


def check_height(name: str, value: Any) -> None:
    """Raise BadInput unless a value in the unit of u is finite and not negative."""
    if not (isinstance(value, Real) and 0.0 <= float(value) < math.inf):
        raise BadInput(f"{name} must be a finite number >= 0, not {value!r}")
