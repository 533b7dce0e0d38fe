"""Recordings in text: a line a time, a column a node."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.columns import goes_with, is_counter, places, without
from chimera_hpc.recordings.dates import (
    Times,
    each,
    is_clock,
    is_compact,
    is_date,
    of_numbers,
    seconds_of,
)
from chimera_hpc.recordings.recording import TIME, Choice, Recording
from chimera_hpc.recordings.text import text_of

_HEAD = 200
_SAMPLE = 1000
"""Lines of numbers whose digits are looked at."""
_MOST = 0.9
_MISSING = ["", "nan", "na", "n/a", "null", "none", ".", "-", "--", "---", "<na>", "inf", "-inf",
            "+inf", "#n/a", "#na", "#num!", "#div/0!", "#value!", "#ref!", "#null!", "#name?",
            "#nv", "#wert!", "#zahl!", "#bezug!"]  # fmt: skip
_FORTRAN = re.compile(r"(?<!\w)([-+]?\d*[.,]\d*)[dD]([-+]\d+)(?!\w)")
"""A number in double precision as Fortran writes it: 1.5D+00."""
_COMMA = re.compile(r"[-+]?\d+(,\d+)?([eE][-+]?\d+)?")


def read_table(path: Path, choice: Choice) -> Recording:
    """Read delimited text: comma, semicolon, tab or blanks; a line with ``#`` first is a comment.

    Lines with words above the numbers name the columns (the first with as many cells as they have)
    or are left out (units, a preamble). Numbers have a point or a comma. Times are the column that
    ``--time`` names, else the one that is called so, else, without names, a first one that rises.
    """
    lines = _lines(path)
    delimiter = _delimiter(lines)
    head, lines = _head(lines, delimiter)
    names, table, notes = _named(head, lines, delimiter)
    every = list(names) or [str(i) for i in range(len(table))]
    left = set(places(every, choice.drop, "--drop")) if names and set(choice.drop) <= set(
        every) else set()  # fmt: skip
    kept = [i for i in range(len(table)) if i not in left]
    columns = {i: _numbers(every[i], table[i]) for i in kept}
    _refuse_points(columns, table, every, [_cells(line, delimiter) for line in lines[:_SAMPLE]])
    time, note = _time(columns, every, choice, bool(names))
    clock = None if time is None else columns[time]
    day = next((i for i in kept if _is_day_of(columns[i], clock)), None)
    nodes = []
    for i in (i for i in kept if i not in (time, day)):
        values = columns[i]
        if isinstance(values, np.ndarray):
            if names and not names[i] and np.isnan(values).all():
                continue  # a delimiter at the end of each line
            nodes.append(i)
        elif time is not None and (TIME.search(every[i]) or is_date(values)):
            notes.append(f"column {every[i]} is left out: the times are column {every[time]}")
        else:
            raise BadInput(f"column {every[i]}: {_no_number(values, every[i])}")
    if not nodes:
        raise BadInput("has no column of signals")
    t, said = None, list[str]()
    if time is not None:
        t, how, said = _times(_on_day(columns, time, day), every[time])
        notes += [note if day is None else f"times: columns {every[day]} and {every[time]}", *how]
    else:
        notes.append("no column of times")
    u = np.column_stack([columns[i] for i in nodes])
    called = tuple(every[i] or "index" for i in nodes) if names else ()
    made = Recording(t, u, called, tuple(notes), tuple(said))
    return made if left else without(made, choice.drop)


def _lines(path: Path) -> list[str]:
    lines = text_of(path.read_bytes()).split("\n")
    found = [line for line in lines if line.strip(" ;,\t") and not line.lstrip().startswith("#")]
    if not found:
        raise BadInput("is empty")
    if _FORTRAN.search(found[-1]):
        found = [_FORTRAN.sub(r"\1E\2", line) for line in found]
    return found


def _delimiter(lines: list[str]) -> str | None:
    """Return what stands between the cells of the last lines; None for blanks."""
    tail = lines[-_HEAD:][-max(1, len(lines) // 2) :]
    for mark in (";", "\t"):
        if np.mean([mark in line for line in tail]) > _MOST:  # a line of words may end the file
            return mark
    words = [line.split() for line in tail]
    # Commas in numbers only, other words without one: dates next to decimal commas.
    blanks = {len(line) > 1 for line in words} == {True} and all(
        "," not in word or _COMMA.fullmatch(word.rpartition(":")[2])
        for line in words
        for word in line
    )
    return "," if not blanks and np.mean(["," in line for line in tail]) > _MOST else None


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return next(csv.reader([" ".join(line.split())], delimiter=" "))
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _head(lines: list[str], delimiter: str | None) -> tuple[list[list[str]], list[str]]:
    """Part the lines of words from those of numbers."""
    head: list[list[str]] = []
    for i, line in enumerate(lines[:_HEAD]):
        cells = _cells(line, delimiter)
        if any(_number(c) for c in cells) and all(_number(c) or _blank(c) or _clock(c)
                                                 for c in cells):  # fmt: skip
            # Columns that are called 0, 1, 2, ... (as pandas writes an index of its own).
            start = (
                1 if not cells[0] and _cells(lines[min(i + 1, len(lines) - 1)], delimiter)[0] else 0
            )
            called = [c for c in cells[start:] if c]
            if head or not (len(called) > 3 and called in (
                    [str(k + b) for k in range(len(called))] for b in (0, 1))):  # fmt: skip
                return head, lines[i:]
        elif len(head) and any(_number(c) for c in cells) and len(cells) == len(head[-1]):
            return head, lines[i:]  # the number that is a word is named later
        head.append(cells)
    raise BadInput(f"has no line of numbers: {lines[-1].strip()[:40]!r} stands in the last one")


def _named(
    head: list[list[str]], lines: list[str], delimiter: str | None
) -> tuple[list[str], list[Any], list[str]]:
    """Return the names, the columns as pandas reads them, and notes."""
    import pandas as pd

    count = _count(lines, delimiter)
    notes, names = [], []
    fitting = [cells for cells in head if len(cells) in (count, count - 1)]
    if fitting:
        chosen = max(fitting, key=lambda cells: len(set(cells)))  # units repeat, names do not
        names = chosen
        if len(names) < count:  # a delimiter ends each line, or R wrote the names of the rows
            ends = not _cells(lines[0], delimiter)[-1]
            names = [*names, ""] if ends else ["", *names]
        notes += [f"left out above the numbers: {' '.join(c)}" for c in head if c is not chosen]
    elif head:
        raise BadInput(f"can't be read as a table: {len(head[-1])} names for {count} columns")
    seen: Counter[str] = Counter()
    for i, name in enumerate(names):
        seen[name] += 1
        if name and seen[name] > 1:
            names[i] = f"{name}.{seen[name] - 1}"
            notes.append(f"two columns are called {name}: the later is {names[i]}")
    dated = [i for i, word in enumerate(_cells(lines[0], delimiter)) if is_compact([word.strip()])]
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(lines)),
            sep=delimiter or r"\s+",
            header=None,
            names=list(range(count)),
            dtype=dict.fromkeys(dated, str),  # 20260131120000.25 has more digits than a float
            skipinitialspace=True,
            index_col=False,
            low_memory=False,
            na_values=[*_MISSING, *map(str.upper, _MISSING)],
        )
    except (pd.errors.ParserError, ValueError) as error:
        raise BadInput(f"can't be read as a table: {' '.join(str(error).split())}") from None
    return names, [table[i] for i in range(count)], notes


def _count(lines: list[str], delimiter: str | None) -> int:
    """Return the cells of a line; BadInput where lines differ: decimal commas would shift them."""
    if '"' in lines[0] or '"' in lines[-1]:
        counts = [len(_cells(line, delimiter)) for line in lines]
    elif delimiter is None:
        counts = [len(line.split()) for line in lines]
    else:
        counts = [line.count(delimiter) + 1 for line in lines]
    usual = Counter(counts).most_common(1)[0][0]
    wrong = next((i for i, n in enumerate(counts[:-1]) if n != usual), None)
    wrong = len(counts) - 1 if wrong is None and counts[-1] > usual else wrong
    if wrong is not None:
        raise BadInput(f"can't be read as a table: line {wrong + 1} of the numbers has "
                       f"{counts[wrong]} cells, others {usual}")  # fmt: skip
    return usual


def _numbers(name: str, column: Any) -> Any:
    """Return a column as float64, or as its words where they are no numbers."""
    if column.dtype.kind in "iuf":
        return column.to_numpy(dtype=np.float64)
    words, filled = column.astype(object), column.notna().to_numpy()
    known = [str(word).strip() for word in words[filled]]
    if is_compact(known):
        return words
    if not each(known, r"[-+]?\d+(\.\d*)?"):
        if not each(known, r"[-+]?[\d.,]*\d[\d.,]*([eE][-+]?\d+)?"):
            return words
        comma = [word for word in known if "," in word]
        if any("." in word for word in comma) or not each(known, r".*,.*|[-+]?\d+|.*[eE].*"):
            return words if not comma else _refuse_commas(name, known)
        if each(known, r"[-+]?([1-9]\d{0,2}(,\d{3})+|\d+)") and not any(
                word.startswith(("0", "-0")) for word in comma):  # fmt: skip
            return _refuse_commas(name, known)
    made = np.full(len(words), np.nan)
    try:
        made[filled] = [float(word.replace(",", ".")) for word in known]
    except ValueError:  # two commas
        return words
    return made


def _refuse_points(
    columns: dict[int, Any], table: list[Any], names: list[str], rows: list[list[str]]
) -> None:
    """Refuse points that seem to separate thousands: 1.234 among 567, or next to decimal commas."""
    commas = any(table[i].dtype.kind == "O" and isinstance(columns[i], np.ndarray) for i in columns)
    for i, values in columns.items():
        if table[i].dtype.kind != "f" or ((values != 0.0) & (np.abs(values) < 1.0)).any():
            continue
        cells = [row[i].strip() for row in rows if i < len(row) and _number(row[i])]
        pointed = [cell for cell in cells if "." in cell]
        if (pointed and (commas or len(pointed) < len(cells))
                and all(re.fullmatch(r"[-+]?[1-9]\d{0,2}\.\d{3}", cell) for cell in pointed)
                and not any(re.fullmatch(r"[-+]?\d{4,}", cell) for cell in cells)):  # fmt: skip
            raise BadInput(f"column {names[i]}: {pointed[0]!r}: does the point separate thousands? "
                           "write numbers without separators of thousands")  # fmt: skip


def _refuse_commas(name: str, known: Any) -> Any:
    word = next(word for word in known if "," in word)
    raise BadInput(f"column {name}: {word!r}: is the comma a decimal one? write points, without "
                   "separators of thousands")  # fmt: skip


def _time(
    columns: dict[int, Any], names: list[str], choice: Choice, named: bool
) -> tuple[int | None, str]:
    """Return the column of the times and how it was found."""
    if choice.time is not None:
        found = [i for i in columns if names[i] == choice.time]
        if not found:
            some = ", ".join(names[:10]) + (", ..." if len(names) > 10 else "")
            raise BadInput(f"--time {choice.time}: the columns are {some}")
        return found[0], f"times: column {choice.time}"
    first, note = next(iter(columns)), ""
    if named:
        called = [i for i in columns if TIME.search(names[i])]
        likely = list(called)
        if not names[first] and not is_counter(columns[first]):
            likely.append(first)
        likely += [i for i in columns if not likely and not isinstance(columns[i], np.ndarray)]
        rising = likely if likely == called and len(likely) == 1 else [
            i for i in likely if _may_rise(columns[i], names[i])]  # fmt: skip
        found = rising or called
        note = f"times: column {names[found[0]] or 'without a name'}" if found else ""
    else:
        rises = len(columns) > 1 and not is_counter(columns[first])
        found = [first] if rises and _may_rise(columns[first], names[first]) else []
        also = [i for i in columns if found and i != first and isinstance(columns[i], np.ndarray)
                and goes_with(columns[i], None)]  # fmt: skip
        if also and isinstance(columns[first], np.ndarray):
            raise BadInput(f"columns {names[first]} and {names[also[0]]} rise as evenly as times "
                           f"do: --time {names[also[0]]} --drop {names[first]}, or the other way "
                           "round, says which are the times")  # fmt: skip
        note = "times: the first column, which rises throughout"
    if found and choice.no_times:
        raise BadInput(f"column {names[found[0]]} holds times: leave --step out, or --drop "
                       f"{names[found[0]]}")  # fmt: skip
    return (found[0], note) if found else (None, "")


def _may_rise(values: Any, name: str) -> bool:
    try:
        t = _times(values, name).t
    except BadInput:
        return False
    return bool((np.diff(t) > 0.0).all())


def _is_day_of(values: Any, clock: Any) -> bool:
    """Whether a column holds the dates of another that holds the times of day."""
    words = clock is not None and not any(isinstance(one, np.ndarray) for one in (values, clock))
    return words and is_clock(clock) and is_date(values)


def _on_day(columns: dict[int, Any], time: int, day: int | None) -> Any:
    if day is None:
        return columns[time]
    return columns[day].astype(str).str.strip() + " " + columns[time].astype(str).str.strip()


def _times(values: Any, name: str) -> Times:
    """Return times, dates in seconds since the first."""
    if isinstance(values, np.ndarray):
        return of_numbers(values)
    if values.isna().any():
        raise BadInput(f"column {name}: time {int(values.isna().argmax())} (from 0) is missing")
    return seconds_of(values.astype(str).str.strip(), name)


def _number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return cell.strip().lower().strip("+-") not in ("nan", "inf", "infinity")


def _blank(cell: str) -> bool:
    return cell.strip().lower() in _MISSING


def _clock(cell: str) -> bool:
    return bool(re.match(r"\d+[-:./]\d+", cell.strip()))


def _no_number(values: Any, name: str) -> str:
    """Say which cell of a column is not a number, and what to do."""
    words = ((i, str(x)) for i, x in values.dropna().items() if not _number(str(x)))
    i, word = next(words, (0, ""))
    again = "the line of names again? save each table to its own file"
    hint = again if word.strip() == name else "--drop leaves columns out"
    return f"{word!r} is not a number (sample {i}, from 0); {hint}"
