"""Amplitude, frequency, phase and baseline of oscillations, window by window (the Fourier method).

In a window, a signal is described by its dominant line (paper, sec. III A and app. B),

    y(t) ~ a0 + a cos(2 pi Omega (t - t_ref) + theta) .

It is found in three steps. (1) Find the largest line of the amplitude spectrum 2 |X_k| / n of
y - <y>, without padding, taper or bin 0. (2) Omega is the vertex of the parabola through this line
and its neighbours. (3) Fit p1 cos(2 pi Omega t + p2) + p3 by least squares with Omega fixed, a
problem that is linear in (p1 cos p2, p1 sin p2, p3). The features are mean and standard deviation
over the windows (eqs. (7), (8)). The share of the signal's energy that the fit explains,

    R^2 = 1 - sum_i (y_i - fit_i)^2 / sum_i (y_i - <y>)^2 ,

tells how far a signal is a sine: 1 for a sine, 0 for white noise.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, fields
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base import renaming
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.renaming import accepts_old_names
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures import lines, windows
from chimera_hpc.measures.averages import average
from chimera_hpc.measures.checks import Array, choice, node_rows
from chimera_hpc.measures.conventions import (
    PhaseMean,
    Preset,
    Refine,
    Steady,
    TimeOrigin,
    WindowReference,
    accepts_presets,
)
from chimera_hpc.measures.signals_input import (
    check_height,
    check_node,
    check_windows,
    checked_signals,
    suspect_prominence,
    suspect_signals,
    suspect_steadiness,
)

QUANTITIES = ("amplitude", "frequency", "phase", "baseline")
FEATURES = (*QUANTITIES, *(f"{name}_std" for name in QUANTITIES))

# What a kernel writes of each window.
_COLUMNS = (*QUANTITIES, "r_squared")
_PHASE = QUANTITIES.index("phase")
_FREQUENCY = QUANTITIES.index("frequency")


@dataclass(frozen=True, eq=False)
class NodeFeatures:
    """Means and standard deviations over windows of the lines of N signals.

    All arrays have shape (N,) and are NaN unless `status` is DONE. The standard deviations are NaN
    for a single window. With steady = "level", other signals have amplitude, frequency and phase 0,
    and their mean in time as baseline. The first fields are those of `FEATURES`, in order.
    """

    amplitude: Array
    frequency: Array  # cycles per unit of time
    phase: Array  # rad, in [-pi, pi)
    baseline: Array
    amplitude_std: Array
    frequency_std: Array
    phase_std: Array  # rad
    baseline_std: Array
    r_squared: Array  # of the fit, mean over the windows; NaN for a constant signal
    n_windows: int  # of each signal; with window_reference "own", the minimum over the signals
    deviation: float  # mean over the signals of the standard deviation in time
    status: Status  # DONE, STEADY or NO_WINDOW

    @property
    def heights(self) -> Array:
        """What V_a compares, (N,): amplitudes; levels (baselines) of signals without any."""
        return self.amplitude if self.status is Status.DONE else self.baseline

    def as_array(self) -> Array:
        """The features as one array (8, N), rows in the order of `FEATURES`."""
        return np.stack([getattr(self, name) for name in FEATURES])


@dataclass(frozen=True, eq=False)
class WindowLines:
    """The lines of N signals in each of up to q windows, before averaging.

    `amplitude`, `frequency`, `phase`, `baseline` and `r_squared` have shape (N, q). `first` and
    `last` (samples, both inside the window) and `counts` have one row per reference signal: 1 for
    window_reference "ring", N for "own". After a row's count, values are NaN and samples 0. All
    fields except `deviation` are empty unless `status` is DONE.
    """

    amplitude: Array
    frequency: Array
    phase: Array
    baseline: Array
    r_squared: Array
    first: windows.Samples
    last: windows.Samples
    counts: windows.Samples
    deviation: float  # mean over the signals of the standard deviation in time
    status: Status


@accepts_old_names(renaming.FEATURES)
@accepts_presets
def fourier_features(
    t: ArrayLike,
    u: ArrayLike,
    *,
    preset: Preset = "default",
    n_peaks: int = 10,
    n_overlap: int = 5,
    max_windows: int = 0,
    prominence: float = 0.0,
    window_reference: WindowReference = "ring",
    reference_node: int = 0,
    phase_mean: PhaseMean = "circular",
    refine: Refine = "parabola",
    time_origin: TimeOrigin = "window",
    steady: Steady = "apart",
    steady_threshold: float = 1e-2,
) -> NodeFeatures:
    r"""Mean and standard deviation of amplitude, frequency, phase and baseline of each signal.

    A window runs from a maximum of the reference signal to its (n_peaks - 1)-th next maximum, both
    samples included. Consecutive windows share n_overlap maxima. For q windows and the value Z^(w)
    of a quantity in window w (eqs. (7), (8)),

        <Z> = sum_w Z^(w) / q ,        sigma_Z^2 = sum_w (Z^(w) - <Z>)^2 / (q - 1) .

    Parameters
    ----------
    t : array_like, shape (T,)
        Uniform times.
    u : array_like, shape (T, N)
        Signals of any model or experiment. An array whose transpose is contiguous is not copied.
    preset : {"default", "paper-printed"}
        Sets the parameters below that `conventions.PRESETS` lists, unless the call does.
    n_peaks, n_overlap : int
        Maxima per window (>= 3), and maxima that consecutive windows share (0 <= n_overlap <
        n_peaks).
    max_windows : int
        Number of windows, counted from the first. 0: all.
    prominence : float
        Least prominence of a maximum, in the unit of u (`windows.maxima`). 0: any.
    window_reference : {"ring", "own"}
        Signal whose maxima define the windows: that of `reference_node` for all signals ("ring"),
        or each signal itself ("own").
    reference_node : int
        Column of u (0-based) of the reference signal; ignored for "own".
    phase_mean : {"circular", "arithmetic"}
        Circular: <theta> = arg sum_w exp(i theta^(w)); deviations are wrapped into [-pi, pi) before
        they are squared. Arithmetic: the formulas above, for phases in [-pi, pi).
    refine : {"parabola", "sine-fit"}
        The three steps above (module), or a least-squares fit of frequency, amplitude, phase and
        baseline together (four-parameter sine fit, IEEE Std 1057-2017). The fit makes Gauss-Newton
        steps from the result of the three steps.
    time_origin : {"window", "recording", "absolute"}
        Phase at the window's first sample, at t[0], or at t = 0. The latter two have the error of
        the frequency times 2 pi (t - t[0]) or 2 pi t, so use the sine fit far from the origin.
    steady : {"apart", "level"}
        Features of signals that do not oscillate (status STEADY or NO_WINDOW): NaN, or amplitude,
        frequency and phase 0 and the mean in time as baseline. Their triplet of total variations is
        then (0, mean ``|<u>_{i+1} - <u>_i|``, 0).
    steady_threshold : float
        Limit for the mean over signals of the standard deviation in time of u, in the unit of u.

    Returns
    -------
    NodeFeatures
        Status STEADY if u varies less than `steady_threshold`; else NO_WINDOW if the reference
        signal ("own": any signal) has fewer than n_peaks maxima; else DONE. Constant signals among
        oscillating ones have amplitude, frequency and phase 0.

    Raises
    ------
    BadInput
        A wrong shape or option, times that are not uniform, or values that are not real, not finite
        or masked.

    Warns
    -----
    UserWarning
        A signal is constant among others or rises throughout, the axes of u seem to be swapped, or
        a run is steady by `steady_threshold` only or without a window by `prominence` only.

    Examples
    --------
    >>> t = np.arange(2001) * 0.01
    >>> u = 3 + np.stack([np.cos(2 * np.pi * t - 1), 2 * np.cos(2 * np.pi * t + 1)], axis=1)
    >>> f = fourier_features(t, u, refine="sine-fit", time_origin="absolute")
    >>> np.stack([f.amplitude, f.frequency, f.phase, f.baseline]).round(9)
    array([[ 1.,  2.],
           [ 1.,  1.],
           [-1.,  1.],
           [ 3.,  3.]])
    >>> f.n_windows, f.status.name
    (3, 'DONE')
    """
    features = measure_signals(
        t,
        u,
        n_peaks=n_peaks,
        n_overlap=n_overlap,
        max_windows=max_windows,
        prominence=prominence,
        window_reference=window_reference,
        reference_node=reference_node,
        phase_mean=phase_mean,
        refine=refine,
        time_origin=time_origin,
        steady=steady,
        steady_threshold=steady_threshold,
    )
    rows = node_rows("u", u)
    suspect = suspect_signals(rows)
    if features.status is Status.STEADY:
        suspect += suspect_steadiness(rows, features.deviation, steady_threshold)
    if features.status is Status.NO_WINDOW:
        suspect += suspect_prominence(rows, n_peaks, prominence)
    for line in suspect:
        warnings.warn(f"fourier_features: {line}", UserWarning, stacklevel=4)
    return features


def measure_signals(
    t: ArrayLike,
    u: ArrayLike,
    *,
    phase_mean: PhaseMean = "circular",
    steady: Steady = "apart",
    **options: Any,
) -> NodeFeatures:
    """Do as `fourier_features`, without the warnings about unlikely signals."""
    choice("phase_mean", phase_mean, get_args(PhaseMean))
    choice("steady", steady, get_args(Steady))
    found = window_lines(t, u, **options)
    out = np.full((len(FEATURES) + 1, found.amplitude.shape[0]), np.nan)
    n_windows = 0
    if found.status is Status.DONE:
        n_windows = int(found.counts.min())
        values = np.stack([getattr(found, name) for name in _COLUMNS])
        average(values, found.counts, phase_mean == "circular", out)
    elif steady == "level":
        out[: len(QUANTITIES)] = 0.0
        out[QUANTITIES.index("baseline")] = node_rows("u", u).mean(axis=1)
    rows = dict(zip((*FEATURES, "r_squared"), out, strict=True))
    return NodeFeatures(**rows, n_windows=n_windows, deviation=found.deviation, status=found.status)


@accepts_old_names(renaming.FEATURES)
def window_lines(
    t: ArrayLike,
    u: ArrayLike,
    *,
    n_peaks: int = 10,
    n_overlap: int = 5,
    max_windows: int = 0,
    prominence: float = 0.0,
    window_reference: WindowReference = "ring",
    reference_node: int = 0,
    refine: Refine = "parabola",
    time_origin: TimeOrigin = "window",
    steady_threshold: float = 1e-2,
) -> WindowLines:
    """Lines of all signals in all windows. Parameters and errors as in `fourier_features`."""
    given = checked_signals(t, u)
    n_nodes = given.x.shape[0]
    placing = check_windows(n_peaks, n_overlap, max_windows)
    reference_node = check_node(reference_node, n_nodes)
    choice("window_reference", window_reference, get_args(WindowReference))
    choice("refine", refine, get_args(Refine))
    choice("time_origin", time_origin, get_args(TimeOrigin))
    check_height("prominence", prominence)
    check_height("steady_threshold", steady_threshold)

    deviation = _mean_deviation(given.x)
    if deviation < steady_threshold:
        return _no_lines(n_nodes, deviation, Status.STEADY)
    own = window_reference == "own"
    references = given.x if own else given.x[reference_node : reference_node + 1]
    first, last, counts = windows.place_windows(references, prominence, *placing)
    if counts.min() == 0:
        return _no_lines(n_nodes, deviation, Status.NO_WINDOW)
    table = np.full((n_nodes, first.shape[1], len(_COLUMNS)), np.nan)
    work = lines.work_arrays(int((last - first).max()) + 1)
    bins = np.full(n_nodes, n_peaks - 1)
    _fill_lines(given.x, first, last, counts, bins, refine == "sine-fit", work, table)
    values = np.ascontiguousarray(table.transpose(2, 0, 1))
    values[_FREQUENCY] /= 2.0 * np.pi * given.dt
    if time_origin != "window":
        origin = given.t[0] if time_origin == "recording" else 0.0
        values[_PHASE] -= 2.0 * np.pi * values[_FREQUENCY] * (given.t[first] - origin)
    values[_PHASE] = wrap(values[_PHASE])
    columns = dict(zip(_COLUMNS, values, strict=True))
    return WindowLines(
        **columns, first=first, last=last, counts=counts, deviation=deviation, status=Status.DONE
    )


def wrap(angle: Array) -> Array:
    """Return an angle (rad) wrapped into [-pi, pi)."""
    inside = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
    return np.where(inside >= np.pi, -np.pi, np.maximum(inside, -np.pi))


def _no_lines(n_nodes: int, deviation: float, status: Status) -> WindowLines:
    none = np.empty((n_nodes, 0))
    samples = np.empty((1, 0), dtype=np.int64)
    counts = np.zeros(1, dtype=np.int64)
    return WindowLines(
        **dict.fromkeys(_COLUMNS, none),
        first=samples,
        last=samples,
        counts=counts,
        deviation=deviation,
        status=status,
    )


@jit()
def _deviations(x: Any, work: Any, out: Any) -> None:
    """Write the standard deviation (ddof 0) in time of each row of x (N, T) into out (N,)."""
    for j in range(x.shape[0]):
        _, energy, _ = lines.centre(x[j], 0, x.shape[1], work.z, work.sums)
        out[j] = math.sqrt(energy / x.shape[1])


@jit()
def _fill_lines(
    x: Any, first: Any, last: Any, counts: Any, bins: Any, refine: bool, work: Any, values: Any
) -> None:
    """Write the lines of each row of x (N, T) in its windows into values (N, q, 5).

    Frequencies are angles per sample. Phases are at the first sample, not wrapped. bins (N,) holds
    a guess for the dominant bin of each row and is updated to its bin in the last window.
    """
    # The outer loop is over windows: signals that share a window also share cached rotations.
    for m in range(first.shape[1]):
        for j in range(x.shape[0]):
            c = j % counts.size
            if m < counts[c]:
                n = last[c, m] - first[c, m] + 1
                bins[j] = lines.window_line(
                    x[j], first[c, m], n, bins[j], refine, work, values[j, m]
                )


def _mean_deviation(x: Array) -> float:
    """Return the mean over signals of the standard deviation in time; BadInput if not finite."""
    deviations = np.empty(x.shape[0])
    _deviations(x, lines.work_arrays(x.shape[1]), deviations)
    if not np.isfinite(deviations).all():
        node = int(np.flatnonzero(~np.isfinite(deviations))[0])
        raise BadInput(f"u must be finite, its squares too: node {node} (column of u) is not")
    return float(deviations.mean())


assert tuple(f.name for f in fields(NodeFeatures))[: len(FEATURES)] == FEATURES
