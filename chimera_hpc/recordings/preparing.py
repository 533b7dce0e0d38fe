"""From a recording to signals on an even grid of times without a gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import number_of
from chimera_hpc.recordings.columns import listed, places, screened, some_of, suspects
from chimera_hpc.recordings.gaps import Gap, find_gaps, longest_stretch, nearby
from chimera_hpc.recordings.recording import Recording

Array = NDArray[np.float64]

_EVEN = 1e-2
"""Largest departure of a time from an even grid, in steps: as `fourier_features` allows."""
_SAME = 1e-6
"""Relative difference below which two steps are the same."""
_SLOWEST = 1e-5
"""Lowest frequency of the low-pass filter, per sample: below, its equations are singular."""
_PADDING = 15
"""Samples that the low-pass filter reflects at each end."""
_LEAST = 1e-100
"""Smallest step of times whose powers are numbers."""
_MOST = 2 * 10**8
"""Most numbers of a series after interpolation."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Signals ready to be measured.

    t (T,), u (T, N): even times, finite values.
    step, recorded_step: step of these times, and of the recording.
    names: names of the nodes, in the order of the columns.
    gaps: all that is missing in the recording, longest first.
    notes, warnings: what was done, and what speaks against it, a line each.
    """

    t: Array
    u: Array
    step: float
    recorded_step: float
    names: tuple[str, ...]
    gaps: tuple[Gap, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def with_times(recording: Recording, step: float | None) -> Recording:
    """Give a recording without times those of `step`.

    Raises BadInput: neither has times, or both; times that are not finite or do not rise.
    """
    own = recording.t is not None
    if recording.t is not None:
        _refuse_times(recording.t)
    if step is None or (np.isfinite(step) and step > 0.0):
        recording = screened(recording, step)
    if recording.t is None:
        if step is None:
            raise BadInput("the file has no times: --step X gives the time between two samples")
        if not (np.isfinite(step) and step > 0.0):
            raise BadInput(f"--step {step}: a number above 0 is needed")
        t = step * np.arange(len(recording.u), dtype=np.float64)
        return replace(recording, t=t)
    if own and step is not None:
        raise BadInput("the file has times of its own: leave --step out")
    return recording


def _refuse_times(t: Array) -> None:
    wrong = np.flatnonzero(~np.isfinite(t))
    if len(wrong):
        raise BadInput(f"time {wrong[0]} (from 0) is missing")
    falls = np.flatnonzero(np.diff(t) <= 0.0)
    if len(falls):
        i = int(falls[0])
        said = f"times must rise: {t[i + 1]:.9g} follows {t[i]:.9g} (samples {i}, {i + 1})"
        if t[i + 1] in t[: i + 1]:
            said += "; one line per time and one column per node are needed"
        raise BadInput(said)


def in_order(recording: Recording, order: str | None) -> Recording:
    """Put the nodes into an order: names or numbers from 0 with commas, or a file of them.

    Nodes that are not named are left out. Raises BadInput for others, and for one named twice.
    """
    if order is None:
        return recording
    columns = places(recording.names, listed(order, "--order"), "--order")
    names = tuple(recording.names[i] for i in columns)
    left = recording.u.shape[1] - len(columns)
    note = f"in the order given: {some_of(names)}" + (f"; {left} left out" if left else "")
    return replace(
        recording, u=recording.u[:, columns], names=names, notes=(*recording.notes, note)
    )


def prepare(
    recording: Recording,
    step: float | None,
    *,
    span: tuple[float | None, float | None] = (None, None),
    bridge: int = 3,
    scale: tuple[float, float] = (1.0, 1.0),
    lowpass: float | None = None,
) -> Prepared:
    """Cut out what is whole and put it on an even grid.

    recording: with times.
    step: step of the grid, None for the recording's own. A recording that has this step is taken as
        it is; any other is interpolated by cubic splines.
    span: first and last time to take, None for the recording's own.
    bridge: samples that may be missing in a row: they are interpolated. At a longer gap the
        recording is cut, and its longest part taken.
    scale: factors on times and on signals.
    lowpass: frequency, in the recording's unit, above which signals are damped, without a shift of
        phase: a Butterworth filter of order 4 that runs forwards and backwards.

    Raises BadInput: nothing is left, or ``lowpass`` is not below half the sampling frequency.
    """
    assert recording.t is not None
    t, u = recording.t * scale[0], np.where(np.isfinite(recording.u), recording.u, np.nan)
    u *= scale[1]
    largest = float(np.nanmax(np.abs(u), initial=0.0))
    if not ((np.diff(t) > _LEAST).all() and np.isfinite(t).all() and largest < 1.0 / _LEAST
            and (largest > _LEAST or not largest)):  # fmt: skip
        raise BadInput("times or signals leave the range of numbers, 1e-100 to 1e100; --factors "
                       "brings them back")  # fmt: skip
    first, last = (x if x is None else x * scale[0] for x in span)
    inside = (t >= (t[0] if first is None else first)) & (t <= (t[-1] if last is None else last))
    t, u = t[inside], u[inside]
    if len(t) < 3:
        where = "in the recording" if len(t) == len(recording.t) else "between --start and --end"
        raise BadInput(f"too few samples {where}: {len(t)}; at least 3 are needed")
    _refuse_empty(u, recording.names)
    usual = float(np.median(np.diff(t)))
    around = nearby(t)
    gaps = find_gaps(t, u, around)
    part = longest_stretch(t, u, around, bridge)
    notes, warned = list(recording.notes), list(recording.warnings)
    if gaps:
        values, times = int(np.isnan(u).sum()), sum(g.samples for g in gaps if g.node is None)
        counts = {"value": values, "time": times}
        what = " and ".join(number_of(n, name) for name, n in counts.items() if n)
        warned.append(f"{what} missing, in {number_of(len(gaps), 'gap')}")
    if part.stop - part.start < 3:
        raise BadInput(f"no stretch without gaps of more than {bridge} samples (--bridge)")
    if part.stop - part.start < len(t):
        warned.append(
            f"taken: {t[part][0]:.6g} to {t[part][-1]:.6g}, {part.stop - part.start} of {len(t)} "
            f"samples, the longest stretch without gaps of more than {bridge} samples"
        )
    warned += suspects(u[part], recording.names)
    made_t, made_u, note = _on_grid(t[part], u[part], usual, step)
    if lowpass is not None:
        made_u = _smooth(made_u, lowpass / scale[0], made_t, usual)
        notes.append(f"frequencies above {lowpass:g} damped (--lowpass)")
    return Prepared(
        *(made_t, made_u, float(made_t[1] - made_t[0]) if step is None else step, usual),
        *(recording.names, tuple(gaps), (*notes, note), tuple(warned)),
    )


def _on_grid(t: Array, u: Array, usual: float, step: float | None) -> tuple[Array, Array, str]:
    own = float(t[-1] - t[0]) / (len(t) - 1)
    even = float(np.abs(t - (t[0] + own * np.arange(len(t)))).max()) <= _EVEN * own
    wanted = (own if even else usual) if step is None else step
    whole = not np.isnan(u).any()
    if even and whole and abs(own - wanted) <= _SAME * wanted:
        return t, u, f"{len(t)} samples at a step of {own:.6g}, as recorded"
    count = int((t[-1] - t[0]) / wanted + 1e-6) + 1
    if count < 3 or count * u.shape[1] > _MOST:
        raise BadInput(
            f"at a step of {wanted:.6g} this is {count} samples; --factors T,U brings the unit of "
            "time to the atlas's"
        )
    grid = t[0] + wanted * np.arange(count)
    steps = np.diff(t)
    why = [] if even else [f"uneven times: steps from {steps.min():.3g} to {steps.max():.3g}"]
    why += [] if whole else ["missing values"]
    why += [] if abs(own - wanted) <= _SAME * wanted else [f"recorded at {usual:.6g}"]
    if whole:
        made = CubicSpline(t, u)(np.minimum(grid, t[-1]))
    else:
        made = np.empty((count, u.shape[1]))
        for node in range(u.shape[1]):
            known = ~np.isnan(u[:, node])
            made[:, node] = CubicSpline(t[known], u[known, node])(np.minimum(grid, t[-1]))
    note = f"{count} samples at a step of {wanted:.6g}, interpolated ({', '.join(why)})"
    return grid, made, note


def _smooth(u: Array, cut: float, t: Array, recorded_step: float) -> Array:
    step = float(t[1] - t[0])
    if not 0.0 < cut < 0.5 / max(step, recorded_step):
        raise BadInput(
            f"--lowpass: {cut:g} per unit of time is not between 0 and half the sampling "
            f"frequency, {0.5 / max(step, recorded_step):g}"
        )
    if cut * step < _SLOWEST:
        raise BadInput(f"--lowpass: {cut:g} per unit of time is too low: at least "
                       f"{_SLOWEST / step:g}")  # fmt: skip
    if len(u) <= _PADDING:
        raise BadInput(f"--lowpass: {len(u)} samples are too few, {_PADDING + 1} are needed")
    sections = butter(4, 2.0 * cut * step, output="sos")
    return np.asarray(sosfiltfilt(sections, u, axis=0))


def _refuse_empty(u: Array, names: Sequence[str]) -> None:
    empty = np.flatnonzero(np.isnan(u).mean(axis=0) > 0.5)
    if len(empty):
        some = ", ".join(names[i] for i in empty[:5].tolist()) + (", ..." * (len(empty) > 5))
        raise BadInput(
            f"more than half of the values of node {some} is missing; --drop leaves it out"
        )
