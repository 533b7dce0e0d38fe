"""Columns that are no nodes, and nodes that are suspect: counters, clocks, dead channels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.recording import TIME, Array, Recording
from chimera_hpc.recordings.text import text_of

_FEWEST = 4
"""Samples below which nothing is said of a column's course."""
STILL = 0.02
"""Standard deviation, in those of the median node, below which a node does not oscillate."""
_HELD = 0.2
"""Share of steps without a change from which a node is suspect, if others change in most."""
_LONG = 50
"""Samples from which a column may be taken for times with some jitter; a shorter one is a slope."""


def listed(text: str, option: str) -> list[str]:
    """Return the words of a list with commas, or of the file that is called so."""
    try:
        text = text_of(Path(text).read_bytes()) if Path(text).is_file() else text
    except BadInput as error:
        raise BadInput(f"{option} {text}: {error}") from None
    except (OSError, ValueError):  # too long for a name of a file
        pass
    words = [word.strip() for word in text.replace("\n", ",").split(",") if word.strip()]
    if not words:
        raise BadInput(f"{option}: no node is named")
    return words


def places(names: Sequence[str], words: Iterable[str], option: str) -> list[int]:
    """Return the columns of these words: names if all of them are, else numbers from 0."""
    asked = list(words)
    if len(asked) == 1 and asked[0] not in names:
        asked = asked[0].split()
    spread = [part for word in asked for part in word.split()]
    for some in (asked, spread):
        if all(word in names for word in some):
            found = [names.index(word) for word in some]
            break
        if all(word.isdecimal() and int(word) < len(names) for word in some):
            found = [int(word) for word in some]
            break
    else:
        numbers = any(word.isdecimal() and int(word) < len(names) for word in spread)
        wrong = next(word for word in spread if word not in names
                     and (not numbers or any(w in names for w in spread)
                          or not word.isdecimal() or int(word) >= len(names)))  # fmt: skip
        raise BadInput(
            f"{option}: {wrong} is no node; there are {len(names)}: {names[0]} to {names[-1]}"
        )
    if len(set(found)) < len(found):
        raise BadInput(f"{option}: {_twice(found, names)} is there twice")
    return found


def _twice(found: list[int], names: Sequence[str]) -> str:
    return names[next(i for i in found if found.count(i) > 1)]


def without(recording: Recording, words: Sequence[str]) -> Recording:
    """Leave nodes out, by name or number from 0."""
    if not words:
        return recording
    left = places(recording.names, words, "--drop")
    note = f"{some_of([recording.names[i] for i in left], 'column')}: left out (--drop)"
    return replace(_but(recording, left), notes=(*recording.notes, note))


def _but(recording: Recording, left: Sequence[int]) -> Recording:
    gone = set(left)
    kept = [i for i in range(len(recording.names)) if i not in gone]
    if not kept:
        raise BadInput("no node is left: all columns are left out, or count samples or times "
                       "(phases that grow? save their cosine)")  # fmt: skip
    names = tuple(recording.names[i] for i in kept)
    return replace(recording, u=recording.u[:, kept], names=names)


def screened(recording: Recording, step: float | None) -> Recording:
    """Take counters of samples, and columns that go with the times, out of the nodes.

    BadInput where there are no times and a column rises as evenly as times do.
    """
    t, u = recording.t, recording.u
    if len(u) < _FEWEST:
        return recording
    counters = [i for i in range(u.shape[1]) if is_counter(u[:, i])]
    clocks = [i for i in range(u.shape[1]) if i not in counters and goes_with(u[:, i], t)]
    if t is None and clocks:
        name = recording.names[clocks[0]]
        raise BadInput(f"column {name} rises as evenly as times do: --time {name} takes it for the "
                       f"times, --drop {name} leaves it out")  # fmt: skip
    if t is None and counters and step is not None:
        count = u[:, counters[0]]
        if (np.diff(count) > 0.0).all():  # where it leaps, samples are missing
            recording = replace(recording, t=step * (count - count[0]))
    doubtful = [i for i in clocks if not TIME.search(recording.names[i])]
    sure = [*counters, *(i for i in clocks if i not in doubtful)]
    notes, said = list(recording.notes), list(recording.warnings)
    if sure:
        who = some_of([recording.names[i] for i in sure], "column")
        notes.append(f"{who}: counts samples or times, not taken for a node")
    if doubtful:
        who = some_of([recording.names[i] for i in doubtful], "column")
        said.append(f"{who}: rises in proportion to the times, left out")
    if sure or doubtful:
        recording = _but(recording, [*sure, *doubtful])
    recording = replace(recording, notes=tuple(notes), warnings=tuple(said))
    return recording


def is_counter(values: Any) -> bool:
    """Whether whole numbers rise by 1, but for some leaps: an index, a counter of samples."""
    if not isinstance(values, np.ndarray) or len(values) < 2 or not np.isfinite(values).all():
        return False
    return bool((values % 1 == 0).all() and np.mean(np.diff(values) == 1.0) > 0.8)


def goes_with(values: Array, t: Array | None) -> bool:
    """Whether a column rises in proportion to the times, or evenly where there are none."""
    if len(values) < _FEWEST or not (np.isfinite(values).all() and (np.diff(values) > 0.0).all()):
        return False
    t = np.arange(len(values), dtype=np.float64) if t is None else t
    scaled = (values - values[0]) / (values[-1] - values[0])
    wanted = (t - t[0]) / (t[-1] - t[0])
    return bool(np.abs(scaled - wanted).max() * (len(t) - 1) < (0.6 if len(t) >= _LONG else 1e-3))


def suspects(u: Array, names: Sequence[str]) -> list[str]:
    """Return a line for each kind of node that seems to be none: still, rising, held, doubled."""
    lines = []
    spread = np.nanstd(u, axis=0)
    still = spread <= STILL * float(np.median(spread))
    if still.all():
        still[:] = False
    if still.any():
        where = np.flatnonzero(still).tolist()
        lines.append(_drop([names[i] for i in where], "hardly varies next to the others"))
    steps = np.diff(u, axis=0)
    one_way = ((steps >= 0.0) | np.isnan(steps)).all(0) | ((steps <= 0.0) | np.isnan(steps)).all(0)
    rising = np.flatnonzero(one_way & (spread > 0.0) & ~still).tolist()
    if len(rising) and len(u) >= _FEWEST:
        lines.append(_drop([names[i] for i in rising], "rises or falls throughout"))
    same = (steps == 0.0).mean(axis=0)
    held = (same > _HELD) & (np.median(same) < 0.5 * _HELD) & ~still & ~one_way
    if held.any():
        where = np.flatnonzero(held).tolist()
        lines.append(_drop([names[i] for i in where], "keeps its value in many steps, unlike the "
                           "others: a switch, a limit, a lost contact"))  # fmt: skip
    first: dict[bytes, int] = {}
    twins = [i for i in range(u.shape[1]) if first.setdefault(u[:, i].tobytes(), i) != i]
    twins = [i for i in twins if spread[i] > 0.0]
    if twins:
        lines.append(_drop([names[i] for i in twins], "has the same values as another node"))
    if _are_phases(u[:, spread > 0.0]):
        lines.append("signals leap by a whole turn: phases? save their cosine, the maxima of "
                     "phases are not those of a signal")  # fmt: skip
    return lines


def _are_phases(u: Array) -> bool:
    """Whether signals go through a turn, in radians or degrees, and leap back by nearly as much."""
    if not u.size or len(u) < _FEWEST:
        return False
    width = np.nanmax(u, axis=0) - np.nanmin(u, axis=0)
    leap = np.nanmax(np.abs(np.diff(u, axis=0)), axis=0, initial=0.0)
    turn = any(((width > 0.9 * full) & (width <= full)).all() for full in (2.0 * np.pi, 360.0))
    return turn and bool((leap > 0.8 * width).all())


def _drop(names: list[str], what: str) -> str:
    return f"{some_of(names)}: {what}; {how_to_drop(names)}"


def how_to_drop(names: Sequence[str]) -> str:
    """Say how nodes are left out."""
    return f"--drop {','.join(names[:5])} leaves it out"


def some_of(names: Sequence[str], kind: str = "node") -> str:
    """Return the first five names, with commas."""
    many = kind if len(names) == 1 else f"{kind}s"
    return f"{many} {', '.join(names[:5])}" + (", ..." if len(names) > 5 else "")
