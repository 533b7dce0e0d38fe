"""What speaks against comparing recordings: copies, other rings, units, sampling, durations."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from hashlib import blake2b

import numpy as np

from chimera_hpc.recordings.file import Recorded

_UNITS = 8.0
"""Factor between medians of recordings from which units may differ: ms and s, mm and cm."""
_SAMPLING = 4.0
"""Factor between sampling steps, or between durations in periods, from which measures may differ:
noise makes more false maxima the finer the step, and few periods scatter more."""
_NAMED = re.compile(
    r"^times: .*[\[(_ ]([nu\u00b5\u03bc]s|m?s|m?secs?|seconds?|min|minutes?|h|hours?)[\])]?$", re.I
)
"""A note on a column or array of times whose name ends with a unit."""
_SECONDS = ("in seconds", "in seconds since the first", "samples per second, by the file")


def copies(files: Sequence[Recorded]) -> Iterator[str]:
    """Yield a line for each oscillating recording with the values of an earlier one."""
    seen: dict[tuple[tuple[int, ...], bytes], Recorded] = {}
    for one in files:
        if one.found.features.n_windows:
            values = np.ascontiguousarray(one.made.u)
            first = seen.setdefault((values.shape, blake2b(values.data).digest()), one)
            if first is not one:
                yield f"{one.path}: the same values as {first.path}; it counts twice"


def differences(files: Sequence[Recorded]) -> Iterator[str]:
    """Yield a line for each thing but its state by which a recording may differ from the others.

    For recordings that are clustered among themselves; an atlas warns for each one by itself.
    """
    moving = [one for one in files if one.found.features.n_windows]
    if not moving:
        return
    low, high = (pick(moving, key=lambda one: one.made.u.shape[1]) for pick in (min, max))
    if low.made.u.shape[1] < high.made.u.shape[1]:
        yield (
            f"{low.made.u.shape[1]} ({low.path}) to {high.made.u.shape[1]} nodes ({high.path}): "
            "along a smooth state, neighbours differ less the more nodes there are"
        )
    yield from _units_of_time(moving)
    step = _spread(moving, lambda one: one.made.recorded_step, _SAMPLING)
    if step:
        yield (
            f"sampling steps of {step}: other units of time? Noise makes more false maxima and "
            "larger variations the finer the step; --lowpass F damps it in all"
        )
    periods = _spread(moving, _periods, _SAMPLING)
    if periods:
        yield f"periods: {periods}: variations over few periods scatter more; --start, --end"
    for name, unit in (("frequency", "unit of frequency"), ("amplitude", "unit of the signal")):
        medians = _spread(moving, partial(_median, name), _UNITS)
        if medians:
            variation = "V_Omega" if name == "frequency" else "V_a"
            yield (
                f"median {name} of {medians}: other units? {variation} has the "
                f"{unit}; classify files of each unit by themselves"
            )


def _median(name: str, one: Recorded) -> float:
    return float(np.median(getattr(one.found.features, name)))


def _periods(one: Recorded) -> float:
    return float(one.made.t[-1] - one.made.t[0]) * _median("frequency", one)


def _spread(files: Sequence[Recorded], size: Callable[[Recorded], float], factor: float) -> str:
    """Return the least and the largest size with their files, if they differ by the factor."""
    low, high = min(files, key=size), max(files, key=size)
    if size(high) <= factor * size(low):
        return ""
    return f"{size(low):.3g} ({low.path}) to {size(high):.3g} ({high.path})"


def _units_of_time(files: Sequence[Recorded]) -> Iterator[str]:
    """Yield a line where columns or arrays of times are in different units, by their names."""
    units: dict[str, Recorded] = {}
    for one in files:
        unit = _unit_of_time(one.made.notes)
        if unit:
            units.setdefault(unit, one)
    if len(units) > 1:
        every = " and ".join(f"{unit} ({one.path})" for unit, one in units.items())
        yield (
            f"times in {every}, taken as they are: V_Omega has the unit of frequency; classify "
            "files of each unit by themselves"
        )


def _unit_of_time(notes: Sequence[str]) -> str:
    """Return ns, us, ms, s, min or h; empty where the notes name none."""
    if any(note.endswith(_SECONDS) for note in notes):
        return "s"
    word = next((found[1].lower() for found in map(_NAMED.match, notes) if found), "")
    starts = (start for start in ("min", "ms", "ns", "h", "s") if word.startswith(start))
    return next(starts, "us" if word else "")
