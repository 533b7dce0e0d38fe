"""What the jobs of the paper have found: their results.json, read once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import ulp
from pathlib import Path
from typing import Any

from chimera_hpc.job.points import ULPS
from chimera_hpc.reduction.conventions import OWN
from chimera_hpc.reduction.results import read_results
from scoreboard.plan import TRIPLETS

Cell = Mapping[str, Any]


class Missing(Exception):
    """Something that a rule needs has not been computed; the text says what."""


class Evidence:
    """Results of jobs in folders beside each other, by the names of the jobs.

    With a convention, those under it, where a job's results depend on it.
    """

    def __init__(self, folder: str | Path, convention: str = OWN) -> None:
        self.folder, self.convention = Path(folder), convention
        self._known: dict[str, dict[str, Any]] = {}

    def job(self, name: str) -> dict[str, Any]:
        """Return results.json of a job; Missing when there is none, or points are pending."""
        if name not in self._known:
            path = self.folder / name / self.convention / "results.json"
            if not path.exists() and name not in TRIPLETS:
                path = self.folder / name / "results.json"
            if not path.exists():
                raise Missing(f"the job {name} has not been run")
            self._known[name] = read_results(path)
        found = self._known[name]
        if found["points"]["pending"]:
            raise Missing(f"the job {name} is not finished")
        return found

    def cells(self, name: str, cut: int) -> list[dict[str, Any]]:
        """Return the cells of a cut, each with its ``family``: its class for the comparison."""
        made = self.job(name)["cuts"].get(str(cut))
        if made is None:
            raise Missing(f"the job {name} has no cut into {cut} classes")
        size = {cluster["name"]: cluster["size"] for cluster in made["clusters"]}
        return [{**cell, "family": family_of(cell["votes"], size)} for cell in made["cells"]]

    def value(self, name: str, path: str) -> Any:
        """Return what lies at a path such as ``curves/stability/least_stable``."""
        found: Any = self.job(name)
        for key in path.split("/"):
            try:
                found = found[int(key)] if isinstance(found, list) else found[key]
            except (KeyError, IndexError, TypeError):
                raise Missing(f"the job {name} has no {path}") from None
        return found


def family_of(votes: Mapping[str, int], size: Mapping[str, int]) -> str | None:
    """Return the modal base class of a cell when steady runs count as ordered.

    Ties go to the class with more members in the whole sweep.
    """
    totals: dict[str, int] = {}
    members: dict[str, int] = {}
    for name, count in votes.items():
        if name == "no_window":
            continue
        family = "ordered" if name == "steady" else base_of(name)
        totals[family] = totals.get(family, 0) + count
    for name, count in size.items():
        members[base_of(name)] = members.get(base_of(name), 0) + count
    return max(totals, key=lambda family: (totals[family], members.get(family, 0)), default=None)


def base_of(name: str) -> str:
    """Return a class without its number: ``ordered-2`` is ordered."""
    return re.sub(r"-\d+$", "", name)


def wanted(value: Any) -> list[Any]:
    """Return the values that a selection names: one, a list, or a range ``a:b``."""
    if isinstance(value, str) and re.fullmatch(r"-?\d+:-?\d+", value):
        low, high = map(int, value.split(":"))
        return list(range(low, high + 1))
    return list(value) if isinstance(value, list | tuple) else [value]


def select(cells: Sequence[Cell], where: Mapping[str, Any]) -> list[Cell]:
    """Return the cells whose coordinates are among the values named.

    A value may also be ``{above = x}`` or ``{below = x}``. Missing when a value that is named does
    not occur, as in a thinned grid.
    """
    found = list(cells)
    for name, value in where.items():
        if isinstance(value, Mapping):
            low, high = value.get("above", -1e300), value.get("below", 1e300)
            found = [cell for cell in found if low < cell[name] < high]
            continue
        kept: list[Cell] = []
        for one in wanted(value):
            margin = ULPS * ulp(one) if isinstance(one, float) else 0
            those = [c for c in found if c[name] == one]
            those = those or [c for c in found if abs(c[name] - one) <= margin]
            if not those:
                raise Missing(f"no cell with {name} = {one}")
            kept.extend(those)
        found = kept
    if not found:
        raise Missing(f"no cell with {dict(where)}")
    return found
