"""Dates and times of day in words, in seconds since the first."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.recording import Array

_DAY, _HOUR = 86400.0, 3600.0
_CLOCK = r"(\d+):(\d{1,2})(?::(\d{1,2}))?(?:[.,](\d+))?\s*([AaPp]\.?[Mm]\.?)?"
_DATE = r"(\d{1,4})([-./])(\d{1,2})\2(\d{1,4})\.?(?:[ T,]+(.*))?"
_COMPACT = r"(\d{4})(\d\d)(\d\d)(?:[ T_-]?(\d\d):?(\d\d)(?::?(\d\d(?:[.,]\d+)?))?)?"


def compact_dates(values: Array) -> tuple[Array, list[str]] | None:
    """Return the seconds of whole numbers YYYYMMDD or YYYYMMDDhhmmss; None for other numbers."""
    import pandas as pd

    for form, least, most in (("%Y%m%d", 18e6, 22e6), ("%Y%m%d%H%M%S", 18e12, 22e12)):
        if ((values >= least) & (values < most) & (values % 1 == 0)).all():
            found = pd.to_datetime(pd.Series(values.astype(np.int64).astype(str)), format=form,
                                   errors="coerce")  # fmt: skip
            if not found.isna().any():
                note = f"numbers like {values[0]:.0f} were taken for dates, in seconds"
                return _seconds(found), [note]
    return None


def seconds_of(words: Any, name: str) -> tuple[Array, list[str]]:
    """Return the seconds since the first of dates or times of day, a pandas series of words.

    The order of day, month and year is the one that makes the steps most even; where none does,
    points mean day first and dashes year first. BadInput where two are as good.
    """
    import pandas as pd

    clock = words.str.fullmatch(_CLOCK)
    if clock.all():
        t, how = _clock(words, name, day=None)
        return t - t[0], [how]
    parts = words.str.extract(f"^{_DATE}$")
    if parts[[0, 1, 2, 3]].notna().all(axis=None):
        rest = parts[4].fillna("00:00")
        if rest.str.fullmatch(_CLOCK).all():
            return _ordered(parts, _clock(rest, name, day=True)[0], name)
    try:
        with warnings.catch_warnings(action="error"):  # an unknown time zone loses hours
            dotted = words.str.replace(r"(\d),(\d+)", r"\1.\2", regex=True)
            form: Any = "ISO8601" if words.str.match(r"\d{4}-?\d\d-?\d\d").all() else "mixed"
            if form == "mixed" and words.str.match(r"\d+[-./]\d+").any():
                raise ValueError(name)
            zoned = words.str.contains(r"(?:Z|[+-]\d\d:?\d\d)$").mean()
            if zoned not in (0.0, 1.0):
                raise ValueError(name)
            found = pd.to_datetime(dotted, format=form, utc=True)
    except (ValueError, TypeError, OverflowError, Warning):
        raise BadInput(f"column {name}: {words.iloc[0]!r} is no time; write seconds, or "
                       "2026-01-31 12:00:00") from None  # fmt: skip
    return _seconds(found), ["dates were taken for seconds since the first"]


def _clock(words: Any, name: str, day: bool | None) -> tuple[Array, str]:
    """Return seconds of times of day; without a date they go on past midnight."""
    parts = words.str.extract(f"^{_CLOCK}$")
    first, second, third = (parts[i].astype(float) for i in range(3))
    digits = parts[3].fillna("0")
    fraction = digits.astype(float) / 10.0 ** digits.str.len()
    if parts[2].notna().all() or day:
        after = parts[4].str.upper().str.replace(".", "", regex=False)
        hours = first.where(after.isna(), first % 12 + 12.0 * (after == "PM"))
        t = hours * _HOUR + second * 60 + third.fillna(0.0) + fraction
        how, period = "times of day hh:mm:ss", _DAY
    elif parts[2].isna().all() and (parts[3].notna().all() or first.max() >= 24):
        t, how, period = first * 60 + second + fraction, "times mm:ss", _HOUR
    else:
        raise BadInput(f"column {name}: {words.iloc[0]!r}: hh:mm or mm:ss? write seconds, or "
                       "hh:mm:ss")  # fmt: skip
    t = t.to_numpy(dtype=np.float64)
    if not day and t.max() < period:
        t = t + period * np.cumsum(np.concatenate([[0], np.diff(t) < -0.5 * period]))
    return t, f"{how}, in seconds"


def _ordered(parts: Any, clock: Array, name: str) -> tuple[Array, list[str]]:
    """Return the seconds of dates in the order that fits them best."""
    import pandas as pd

    wide = [int(parts[i].str.len().max()) for i in (0, 2, 3)]
    mark = parts[1].iloc[0]
    if 4 in wide:
        orders: tuple[str, ...] = {0: ("ymd", "ydm"), 1: ("dym", "myd"), 2: ("dmy", "mdy")}[
            wide.index(4)
        ]
    else:
        orders = ("dmy", "mdy", "ymd", "ydm")
    made: list[tuple[float, str, Array]] = []
    for order in orders:
        cells = {key: parts[i].astype(int) for key, i in zip(order, (0, 2, 3), strict=True)}
        year = cells["y"].where(cells["y"] > 99, cells["y"] + 2000)
        day = pd.to_datetime({"year": year, "month": cells["m"], "day": cells["d"]},
                             errors="coerce")  # fmt: skip
        if day.isna().any():
            continue
        t = _seconds(day) + clock
        steps = np.diff(t)
        if (steps > 0.0).all():
            uneven = (
                float(np.mean(np.abs(steps / np.median(steps) - 1.0) > 0.5)) if len(steps) else 0.0
            )
            made.append((uneven, order, t - t[0]))
    if not made:
        raise BadInput(f"column {name}: dates do not rise, in whatever order of day, month and "
                       "year (a clock set back by summer time?)")  # fmt: skip
    best = [one for one in made if one[0] <= min(made)[0]]
    usual = mark == "." or orders[0] == "ymd"
    if any(not np.array_equal(one[2], best[0][2]) for one in best[1:]) and not usual:
        raise BadInput(f"column {name}: {' or '.join(one[1] for one in best)}? the order of day, "
                       "month and year is open; write 2026-01-31")  # fmt: skip
    names = {"d": "day", "m": "month", "y": "year"}
    said = ", ".join(names[key] for key in best[0][1])
    return best[0][2], [f"dates were taken for seconds since the first; order: {said}"]


def _seconds(found: Any) -> Array:
    """Seconds since the first, to the nanosecond."""
    whole = found.to_numpy().astype("datetime64[ns]").astype(np.int64)
    return np.asarray((whole - whole[0]) / 1e9, dtype=np.float64)
