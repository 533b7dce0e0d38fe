"""Dates and times of day in words, in seconds since the first."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.recording import Array

_DAY, _HOUR = 86400.0, 3600.0
_CLOCK = r"(?:(\d+) days?,? +)?(\d+):(\d{1,2})(?::(\d{1,2}))?(?:[.,](\d+))?\s*([AaPp]\.?[Mm]\.?)?"
_DAY_ONLY = r"(\d{1,4})([-./])(\d{1,4})\2(\d{1,4})\.?"
_DATE = _DAY_ONLY + r"(?:[ T,]+(.*))?"
_COMPACT = (
    r"((?:1[89]|2[01])\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01]))"
    r"(?:[ T_-]?([01]\d|2[0-3]):?([0-5]\d)(?::?([0-5]\d)(?:[.,]?(\d+))?)?)?"
)
DATED = "dates were taken for seconds since the first"
_UNITS = (("seconds", 1.0), ("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
"""What times since 1970 are counted in."""
_DAYS = {"a spreadsheet": (25e3, 80e3), "MATLAB": (7e5, 8e5)}
"""Dates of 1968 to 2119 and of 1916 to 2190 as numbers of days."""


class Times(NamedTuple):
    """Seconds (T,), what was understood, and what speaks against it."""

    t: Array
    notes: list[str]
    warnings: list[str]


def is_compact(words: Any) -> bool:
    """Whether these are dates without marks between their parts: YYYYMMDD, YYYYMMDDhhmm, ..."""
    return each(words, _COMPACT)


def is_date(words: Any) -> bool:
    """Whether these are dates without a time of day."""
    return each(words, _DAY_ONLY) or (each(words, r"\d{8}") and is_compact(words))


def is_clock(words: Any) -> bool:
    """Whether these are times of day."""
    return each(words, _CLOCK)


def each(words: Iterable[Any], pattern: str) -> bool:
    """Whether each of these words is whole what the pattern says; it ends at the first other."""
    whole = re.compile(pattern).fullmatch
    return all(isinstance(word, str) and whole(word) for word in words)


def of_numbers(values: Array) -> Times:
    """Return numbers as they are, but dates YYYYMMDD, ... in seconds since the first.

    Numbers that look like times since 1970 in another unit than seconds, or like the days that
    spreadsheets and MATLAB count, are warned of.
    """
    import pandas as pd

    low, high = (values.min(), values.max()) if np.isfinite(values).all() else (0.0, 0.0)
    if low >= 18e6 and high < 22e12 and (values % 1 == 0).all():
        words = pd.Series(values.astype(np.int64).astype(str))
        if is_compact(words):
            return _compact(words)
    for name, factor in _UNITS[1:]:
        if 0.9e9 * factor <= low and high < 2.2e9 * factor:
            said = (f"times look like {name} since 1970: frequencies are per {name[:-1]}; "
                    f"--factors {1.0 / factor:g},1 makes them per second")  # fmt: skip
            return Times(values, [], [said])
    for program, (first, end) in _DAYS.items():
        if first <= low and high < end and np.median(np.diff(values)) < 60.0 / _DAY:
            said = (f"times look like dates as {program} counts them, in days: frequencies are per "
                    "day; --factors 86400,1 makes them per second")  # fmt: skip
            return Times(values, [], [said])
    return Times(values, [], [])


def seconds_of(words: Any, name: str) -> Times:
    """Return the seconds since the first of dates or times of day, a pandas series of words.

    The order of day, month and year is the one that makes the steps most even; where none does,
    points mean day first and dashes year first. BadInput where two are as good.
    """
    import pandas as pd

    words = words.str.replace(r"\s*(?:UTC|GMT)$", "Z", regex=True)
    if is_clock(words):
        t, notes, said = _clock(words, name, dated=False)
        return Times(t - t[0], notes, said)
    if is_compact(words):
        return _compact(words)
    parts = words.str.extract(f"^{_DATE}$")
    if parts[[0, 1, 2, 3]].notna().all(axis=None):
        rest = parts[4].fillna("00:00")
        if is_clock(rest):
            return _ordered(parts, _clock(rest, name, dated=True).t, name)
    try:
        with warnings.catch_warnings(action="error"):  # an unknown time zone loses hours
            dotted = words.str.replace(r"(\d),(\d+)", r"\1.\2", regex=True)
            form: Any = "ISO8601" if words.str.match(r"\d{4}-?\d\d-?\d\d").all() else "mixed"
            if form == "mixed" and words.str.match(r"\d+[-./]\d+|\d+$").any():
                raise ValueError(name)
            zoned = words.str.contains(r"(?:Z|[+-]\d\d:?\d\d)$").mean()
            if zoned not in (0.0, 1.0):
                raise ValueError(name)
            found = pd.to_datetime(dotted, format=form, utc=True)
    except (ValueError, TypeError, OverflowError, Warning):
        strange = words[~words.str.fullmatch(r"[-+.,\deE]+|[\d:.,\s/TZ-]+")]
        word = words.iloc[0] if strange.empty else strange.iloc[0]
        raise BadInput(f"column {name}: {word!r} is no time; write seconds, or "
                       "2026-01-31 12:00:00") from None  # fmt: skip
    return Times(_seconds(found), [DATED], [])


def _compact(words: Any) -> Times:
    import pandas as pd

    parts = words.str.extract(f"^{_COMPACT}$").fillna("0")
    days = pd.to_datetime(parts[0], format="%Y%m%d", errors="coerce")
    if days.isna().any():
        raise BadInput(f"{words[days.isna()].iloc[0]!r} is no date")
    hour, minute, second = (parts[i].astype(float).to_numpy() for i in (1, 2, 3))
    fraction = parts[4].astype(float) / 10.0 ** parts[4].str.len()
    t = _seconds(days) + _HOUR * hour + 60.0 * minute + second + fraction.to_numpy()
    note = f"numbers like {words.iloc[0]} were taken for dates, in seconds since the first"
    return Times(t - t[0], [note], [])


def _clock(words: Any, name: str, dated: bool) -> Times:
    """Return seconds of times of day; without a date they go on past midnight."""
    parts = words.str.extract(f"^{_CLOCK}$")
    days, first, second, third = (parts[i].astype(float) for i in range(4))
    digits = parts[4].fillna("0")
    fraction = digits.astype(float) / 10.0 ** digits.str.len()
    said: list[str] = []
    if dated or third.notna().all() or _says(name, r"h+:m"):
        after = parts[5].str.upper().str.replace(".", "", regex=False)
        hours = first.where(after.isna(), first % 12 + 12.0 * (after == "PM"))
        t = days.fillna(0.0) * _DAY + hours * _HOUR + second * 60 + third.fillna(0.0) + fraction
        how, period = "times of day hh:mm:ss", _DAY
        wrong = (second >= 60.0) | (third >= 60.0) | ((first >= 24.0) & (days.notna() | dated))
    elif third.isna().all() and (
        parts[4].notna().any() or first.max() >= 24 or _says(name, r"m+:s")
    ):
        t, how, period = first * 60 + second + fraction, "times mm:ss", _HOUR
        wrong = second >= 60.0
        if parts[4].isna().all() and not _says(name, r"m+:s") and not (first.diff() < -30.0).any():
            said.append(f"{words.iloc[-1]!r} was taken for mm:ss; if it is hh:mm, call the column "
                        "'time hh:mm'")  # fmt: skip
    else:
        raise BadInput(f"column {name}: {words.iloc[0]!r}: hh:mm or mm:ss? call the column "
                       "'time mm:ss' or 'time hh:mm', or write seconds")  # fmt: skip
    if wrong.any():
        raise BadInput(f"column {name}: {words[wrong].iloc[0]!r} is no time: hours go to 23, "
                       "minutes and seconds to 59")  # fmt: skip
    t = t.to_numpy(dtype=np.float64)
    if not dated and t.max() < period:
        t = t + period * np.cumsum(np.concatenate([[0], np.diff(t) < -0.5 * period]))
    return Times(t, [f"{how}, in seconds"], said)


def _says(name: str, form: str) -> bool:
    return re.search(form, name, re.IGNORECASE) is not None


def _ordered(parts: Any, clock: Array, name: str) -> Times:
    """Return the seconds of dates in the order that fits them best."""
    wide = [int(parts[i].str.len().max()) for i in (0, 2, 3)]
    mark = parts[1].iloc[0]
    orders: tuple[str, ...] = ("dmy", "mdy", "ymd", "ydm")
    if 4 in wide:
        orders = {0: orders[2:], 1: ("dym", "myd"), 2: orders[:2]}[wide.index(4)]
    made = [one for order in orders if (one := _read_as(order, parts, clock)) is not None]
    if not made:
        raise BadInput(f"column {name}: dates do not rise, in whatever order of day, month and "
                       "year (a clock set back by summer time? several lines a time?)")  # fmt: skip
    best = [one for one in made if one[0] <= min(made)[0]]
    if mark == ".":  # day first; with two digits of the year, the day is what changes fastest
        best = [one for one in best if one[1] != "mdy"] or best
        best.sort(key=lambda one: 0.0 if 4 in wide else float(one[2][-1]))
    usual = mark == "." or orders[0] == "ymd"
    if any(not np.array_equal(one[2], best[0][2]) for one in best[1:]) and not usual:
        raise BadInput(f"column {name}: {' or '.join(one[1] for one in best)}? the order of day, "
                       "month and year is open; write 2026-01-31")  # fmt: skip
    names = {"d": "day", "m": "month", "y": "year"}
    said = ", ".join(names[key] for key in best[0][1])
    note = f"{DATED}; order: {said}"
    return Times(best[0][2], [note], [])


def _read_as(order: str, parts: Any, clock: Array) -> tuple[float, str, Array] | None:
    """Return the share of uneven steps, the order and the seconds; None if no such dates rise."""
    import pandas as pd

    cells = {key: parts[i].astype(int) for key, i in zip(order, (0, 2, 3), strict=True)}
    year = cells["y"].where(cells["y"] > 99, cells["y"] + 2000)
    day = pd.to_datetime({"year": year, "month": cells["m"], "day": cells["d"]}, errors="coerce")
    if day.isna().any():
        return None
    t = _seconds(day) + clock
    steps = np.diff(t)
    if not (steps > 0.0).all():
        return None
    uneven = np.mean(np.abs(steps / np.median(steps) - 1.0) > 0.5) if len(steps) else 0.0
    return float(uneven), order, t - t[0]


def _seconds(found: Any) -> Array:
    """Seconds since the first, to the nanosecond."""
    whole = found.to_numpy().astype("datetime64[ns]").astype(np.int64)
    return np.asarray((whole - whole[0]) / 1e9, dtype=np.float64)
