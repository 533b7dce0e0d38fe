"""Why a claim does not reproduce: how often chance would have it hold, and what else was found."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput

KINDS = ("chance", "convention", "misprint", "contradiction", "not decidable", "unexplained")
BY_CHANCE = 0.05
"""A claim that holds in at least this share of the redrawn sweeps may fail by chance."""


@dataclass(frozen=True)
class Cause:
    """Why claims do not reproduce."""

    kind: str
    """One of `KINDS`."""
    found: str
    """The experiment and its numbers."""


def read_causes(path: str | Path, known: Iterable[str]) -> dict[str, Cause]:
    """Read causes by the claim's id; BadInput for an unknown kind, key or claim."""
    known = set(known)
    causes: dict[str, Cause] = {}
    for table in tomllib.loads(Path(path).read_text(encoding="utf-8"))["cause"]:
        names = table.get("claims", [])
        if set(table) != {"claims", "kind", "found"}:
            raise BadInput(f"{path}: {names}: the keys of a cause are claims, kind, found")
        if table["kind"] not in KINDS:
            raise BadInput(f"{path}: {names}: kind {table['kind']!r}; known: {', '.join(KINDS)}")
        if unknown := [name for name in names if name not in known or name in causes]:
            raise BadInput(f"{path}: {unknown[0]} is no claim, or has two causes")
        causes |= dict.fromkeys(names, Cause(table["kind"], table["found"].strip()))
    return causes


def explain(
    claim: str, causes: Mapping[str, Cause], chance: Mapping[str, Mapping[str, int]]
) -> dict[str, Any]:
    """Return the cause of a claim that does not reproduce, as results.json has it.

    `chance` counts by convention in how many of how many redrawn sweeps the claim holds. From
    `BY_CHANCE` on, under any convention, the kind is "chance", whatever else was found.
    """
    cause = causes.get(claim, Cause("unexplained", ""))
    by_chance = any(count["holds"] >= BY_CHANCE * count["of"] for count in chance.values())
    return {
        "kind": "chance" if by_chance else cause.kind,
        "found": cause.found,
        "redrawn": {name: dict(count) for name, count in chance.items()},
    }


def cause_text(cause: Mapping[str, Any] | None) -> str:
    """Return one cell of the table."""
    if cause is None:
        return ""
    drawn = ", ".join(
        f"{count['holds']} of {count['of']} ({name})" for name, count in cause["redrawn"].items()
    )
    counted = f"holds in {drawn} redrawn sweeps" if drawn else ""
    told = ". ".join(part for part in (counted, " ".join(cause["found"].split())) if part)
    return f"{cause['kind']}: {told}" if told else str(cause["kind"])
