"""A recording as it was read: times, signals, and what was understood of the file."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput

Array = NDArray[np.float64]

TIME = re.compile(
    r"^(t|s|ms|secs?|seconds?|msec|zeit|uhrzeit|elapsed|datum)(?![^\W_])"
    r"|(?<![^\W_])(times?|timestamps?|dates?|datetime|seconds|zeit|temps|tiempo|tempo|elapsed)"
    r"(?![^\W_])",
    re.IGNORECASE,
)
"""What columns and arrays of times are called: time, time_s, t [s], Zeit, elapsed, ..."""
_SMOOTH = 4.0
"""Factor between mean squares of steps along two axes from which the axes may be swapped."""


@dataclass(frozen=True)
class Choice:
    """What the user says of a file; None and empty where the file speaks for itself."""

    variable: str | None = None
    """Name of the array or variable that holds the signals."""
    time: str | None = None
    """Name, or number from 0, of the column, array, coordinate or dimension of the times."""
    select: tuple[tuple[str, int], ...] = ()
    """Other dimensions, each with the index to take."""
    transpose: bool = False
    """Whether rows are nodes and columns are times."""
    no_times: bool = False
    """Whether every column is a node: the user gives the step."""
    drop: tuple[str, ...] = ()
    """Columns to leave out, by name or number from 0."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals of N nodes at T times.

    t (T,): times; seconds where the file has dates. None where the file has none.
    u (T, N): NaN where a value is missing.
    names: names of the nodes, their numbers from 0 where the file has none.
    notes, warnings: what was taken for what, and what speaks against it, a line each.
    """

    t: Array | None
    u: Array
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.names:
            object.__setattr__(self, "names", tuple(map(str, range(self.u.shape[1]))))


def as_signals(name: str, values: Any) -> Array:
    """Return an array of real numbers as float64; BadInput for other types and dimensions."""
    array = np.ma.filled(np.ma.asarray(values), np.nan) if np.ma.isMA(values) else values
    array = np.asarray(array)
    if array.dtype.kind not in "iuf":
        raise BadInput(f"{name}: {array.dtype} are not real numbers")
    if array.ndim != 2 or array.size == 0:
        raise BadInput(f"{name}: (times, nodes) is needed, not the shape {array.shape}")
    return array.astype(np.float64)


def as_times(name: str, values: Any) -> Array:
    """Return times as float64, dates in seconds since the first; BadInput for others."""
    times = np.asarray(values)
    times = times.ravel() if times.ndim == 2 and 1 in times.shape else times
    if times.dtype.kind in "mM":
        whole = times.astype("datetime64[ns]" if times.dtype.kind == "M" else "timedelta64[ns]")
        if np.isnat(whole).any():
            raise BadInput(f"{name}: a date is missing")
        elapsed = (whole - whole.ravel()[0]).astype(np.int64)
        return np.asarray(elapsed, dtype=np.float64) / 1e9
    if times.dtype.kind not in "iuf" or times.ndim != 1:
        raise BadInput(f"{name}: one real number a sample is needed, not {times.dtype}")
    return times.astype(np.float64)


def turned(recording: Recording, choice: Choice) -> Recording:
    """Put times along the first axis, as the user or the number of times says."""
    u, t = recording.u, recording.t
    fits, fits_turned = (t is not None and len(t) == n for n in u.shape)
    along, across = (float(np.nanmean(np.diff(u, axis=i) ** 2)) if min(u.shape) > 1 else 0.0
                     for i in (0, 1))  # fmt: skip
    open_ = not choice.transpose and (t is None or (fits and fits_turned))
    if open_ and t is None and u.shape[1] > u.shape[0] and across < along:
        raise BadInput(
            f"{u.shape[0]} times of {u.shape[1]} nodes, smoother along the rows: are these times? "
            "--transpose turns them; else save the times too (.npz with an array t)"
        )
    if choice.transpose or (fits_turned and not fits):
        note = f"rows are nodes: {u.shape[0]} nodes, {u.shape[1]} times"
        recording = Recording(t, u.T, (), (*recording.notes, note), recording.warnings)
        u = recording.u
    elif open_ and (across < along / _SMOOTH or (t is None and u.shape[1] > u.shape[0])):
        said = (f"{u.shape[0]} times of {u.shape[1]} nodes were read: if rows are nodes, "
                "--transpose turns them")  # fmt: skip
        recording = replace(recording, warnings=(*recording.warnings, said))
    if t is not None and len(t) != len(u):
        raise BadInput(f"{len(t)} times for {len(u)} samples of {u.shape[1]} nodes")
    return recording
