"""Recordings in text: a line a time, a column a node."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.recording import Choice, Recording, as_signals, as_times

_HEAD = 50
_DELIMITERS = (";", "\t", ",")
_MISSING = ("", "nan", "na", "n/a", "null", "-", "inf", "-inf")
_TIME = re.compile(r"(t|times?|timestamp|date|datetime|seconds)\b", re.IGNORECASE)


def read_table(path: Path, choice: Choice) -> Recording:
    """Read delimited text: comma, semicolon, tab or blanks; ``#`` begins a comment.

    A first line with words names the columns. Times are the column that ``--time`` names, else the
    one that is called time (or t, date, ...), else, in a table without names, a first column that
    rises throughout.
    """
    import pandas as pd

    with path.open(encoding="utf-8-sig") as file:
        lines = (line.partition("#")[0].strip("\n\r ") for line in file)
        head = [line for line, _ in zip(filter(None, lines), range(_HEAD), strict=False)]
    if not head:
        raise BadInput("is empty")
    delimiter = next((d for d in _DELIMITERS if d in head[-1]), None)
    decimal = "," if delimiter == ";" and "," in head[-1] else "."
    named = any(_is_word(cell, decimal) for cell in head[0].split(delimiter))
    if named and len(head) == 1:
        raise BadInput("has a line of names and no other")
    try:
        with warnings.catch_warnings(action="error"):  # a line that is too long loses data
            table = pd.read_csv(
                path,
                sep=delimiter or r"\s+",
                header=0 if named else None,
                comment="#",
                decimal=decimal,
                encoding="utf-8-sig",
                skipinitialspace=True,
                index_col=False,
                na_values=["-", "inf", "-inf"],
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, ValueError) as error:
        raise BadInput(f"can't be read as a table: {' '.join(str(error).split())}") from None
    table.columns = [str(name).strip() for name in table.columns]
    time, note = _time_column(table, choice, named)
    nodes = [name for name in table.columns if name != time]
    for name in nodes:
        if table[name].dtype.kind not in "iuf":
            raise BadInput(f"column {name}: {_first_word(table[name])!r} is not a number")
    t = None if time is None else as_times(time, _times(table[time], time))
    u = as_signals("table", table[nodes].to_numpy(dtype=np.float64))
    return Recording(t, u, tuple(nodes) if named else (), (note,))


def _time_column(table: Any, choice: Choice, named: bool) -> tuple[str | None, str]:
    columns = list(table.columns)
    if choice.no_times:
        return None, "every column is a node"
    if choice.time is not None:
        if choice.time not in columns:
            some = ", ".join(columns[:10]) + (", ..." if len(columns) > 10 else "")
            raise BadInput(f"--time {choice.time}: the columns are {some}")
        return choice.time, f"times: column {choice.time}"
    if named:
        found = next((name for name in columns if _TIME.match(name)), None)
        return found, f"times: column {found}" if found else "every column is a node"
    first = table[columns[0]]
    values = first.to_numpy()
    rises = len(columns) > 1 and first.dtype.kind in "iuf" and bool((np.diff(values) > 0).all())
    if rises:
        return columns[0], "times: the first column, which rises throughout"
    return None, "every column is a node"


def _times(column: Any, name: str) -> Any:
    import pandas as pd

    if column.dtype.kind in "iuf":
        return column.to_numpy()
    try:
        return pd.to_datetime(column, utc=True).dt.tz_localize(None).to_numpy()
    except (ValueError, TypeError):
        raise BadInput(f"column {name}: {_first_word(column)!r} is no time") from None


def _first_word(column: Any) -> str:
    return next((str(x) for x in column if _is_word(str(x), ".")), str(column.iloc[0]))


def _is_word(cell: str, decimal: str) -> bool:
    text = cell.strip().strip('"').replace(decimal, ".")
    try:
        float(text)
    except ValueError:
        return text.lower() not in _MISSING
    return False
