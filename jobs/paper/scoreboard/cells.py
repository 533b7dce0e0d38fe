"""The audit cell by cell: the error bar of a phase diagram.

A random 2 % of all points leaves most cells with one audited point or none. So a cell says how many
were audited and what became of them; what holds for every cell is the bootstrap over its seeds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.job import Points
from chimera_hpc.reduction.cells import FreeAxis, free_axes
from scoreboard.evidence import base_of, family_of

_DRAWS = 1000
_STEADY, _NO_WINDOW = "steady", "no_window"


class Resampled(NamedTuple):
    """What resampling the seeds of a cell says about its modal class."""

    stays: float
    """Share of the draws with the same modal class."""
    low: float
    high: float
    """Middle 95 % of the share of this class."""


def axes_of(points: Points) -> list[FreeAxis]:
    """Return what varies between the cells of a sweep."""
    return free_axes(points.cells()[1], [name for name in points.axes if name != "seed"])


def audit_cells(
    points: Points,
    labels: Sequence[str],
    chosen: NDArray[np.int64],
    again: Mapping[str, Sequence[str]],
    rng: np.random.Generator,
    every: bool = True,
) -> list[dict[str, Any]]:
    """Return the cells with their votes, modal class, bootstrap and audited points.

    Parameters
    ----------
    labels : (n,)
        Class of each of the points.
    chosen : (m,)
        The audited points.
    again : of str to (m,)
        Their classes after each way of running again.
    every
        Whether cells without an audited point are listed too.
    """
    number, _ = points.cells()
    axes = axes_of(points)
    size = Counter(labels)
    members: dict[int, list[int]] = {}
    for i, cell in enumerate(number.tolist()):
        members.setdefault(cell, []).append(i)
    audited: dict[int, list[int]] = {}
    for place, i in enumerate(chosen.tolist()):
        audited.setdefault(int(number[i]), []).append(place)
    cells = []
    for cell, runs in members.items():
        places = audited.get(cell, [])
        if not (places or every):
            continue
        votes = Counter(labels[i] for i in runs)
        modal = family_of(votes, size)
        entry: dict[str, Any] = {
            name: axis.values[cell].item() for axis in axes for name in axis.names
        }
        entry |= {"votes": dict(votes), "class": modal, "audited": len(places)}
        if modal is not None:
            entry |= resample(votes, modal, size, rng)._asdict()
        if places:
            before = [labels[chosen[place]] for place in places]
            entry |= {
                way: change(before, [after[place] for place in places])
                for way, after in again.items()
            }
        cells.append(entry)
    return cells


def change(before: Sequence[str], after: Sequence[str]) -> dict[str, Any]:
    """Return the change of the class fractions between two labellings of the same runs.

    ``net``: change of each class's share, where there is one. ``moves``: labels that changed.
    """
    first, second = Counter(before), Counter(after)
    pairs = list(zip(before, after, strict=True))
    return {
        "changed": sum(a != b for a, b in pairs),
        "net": {
            name: (second[name] - first[name]) / len(before)
            for name in sorted({*first, *second})
            if second[name] != first[name]
        },
        "moves": dict(Counter(f"{a} to {b}" for a, b in pairs if a != b)),
    }


def resample(
    votes: Mapping[str, int],
    modal: str,
    size: Mapping[str, int],
    rng: np.random.Generator,
) -> Resampled:
    """Resample the votes of a cell; ties go to the class with more members in the whole sweep."""
    families, members = families_of(votes), families_of(size)
    names = sorted(families, key=lambda family: -members[family])
    counts = np.array([families[name] for name in names], dtype=np.float64)
    drawn = rng.multinomial(int(counts.sum()), counts / counts.sum(), size=_DRAWS)
    share = drawn[:, names.index(modal)] / counts.sum()
    low, high = (float(end) for end in np.quantile(share, (0.025, 0.975)))
    stays = float(np.mean(drawn.argmax(axis=1) == names.index(modal)))
    return Resampled(stays, low, high)


def families_of(votes: Mapping[str, int]) -> Counter[str]:
    """Add up votes by base class; steady runs count as ordered, runs without a window for none."""
    families = Counter[str]()
    for name, count in votes.items():
        if name != _NO_WINDOW:
            families["ordered" if name == _STEADY else base_of(name)] += count
    return families


def share_of(votes: Mapping[str, int], modal: str | None) -> float:
    """Return the share of a class among a cell's runs; NaN without a class."""
    families = families_of(votes)
    return families[modal] / families.total() if modal is not None else float("nan")


def total_variation(net: Mapping[str, float]) -> float:
    """Return which share of the runs would have to move for such a change of class fractions."""
    return 0.5 * sum(map(abs, net.values()))
