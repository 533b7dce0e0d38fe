"""The scoreboard: claims read from jobs/paper/claims.toml, judged by rules, written as tables."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from scoreboard.causes import cause_text
from scoreboard.evidence import Evidence, Missing
from scoreboard.rules import NOT_DECIDABLE, NOT_REPRODUCED, REPRODUCED, RULES, Finding

DEFAULT = "default"
"""The convention of the jobs as they are."""
_KEYS = {"id", "where", "says", "rule", "command", "check", "args", "quick"}


@dataclass(frozen=True)
class PaperClaim:
    """One statement of the paper and how it is judged."""

    id: str
    where: str
    """Section or label of the figure."""
    says: str
    rule: str
    command: str
    check: str
    """Name of a function in `rules`."""
    args: dict[str, Any] = field(default_factory=dict)
    quick: bool = False
    """Whether it survives thinned grids."""

    def judge(self, evidence: Evidence) -> Finding:
        """Apply the rule."""
        try:
            return RULES[self.check](evidence, **self.args)
        except Missing as reason:
            return Finding(NOT_DECIDABLE, str(reason))


def read_claims(path: str | Path) -> list[PaperClaim]:
    """Read a file of claims; BadInput when one is malformed or an id occurs twice."""
    tables = tomllib.loads(Path(path).read_text())["claim"]
    for table in tables:
        if wrong := set(table) - _KEYS:
            raise BadInput(f"{path}: {table.get('id')}: unknown keys {', '.join(sorted(wrong))}")
        if table.get("check") not in RULES:
            raise BadInput(f"{path}: {table.get('id')}: no rule {table.get('check')}")
    claims = [PaperClaim(**table) for table in tables]
    if twice := [name for name, count in Counter(c.id for c in claims).items() if count > 1]:
        raise BadInput(f"{path}: {twice[0]} occurs twice")
    return claims


def scoreboard(
    claims: Iterable[PaperClaim], evidence: Evidence, others: Mapping[str, Evidence] | None = None
) -> list[dict[str, Any]]:
    """Judge every claim: rows as results.json holds them under ``claims``.

    ``reproduced`` is true, false, or None where it can't be decided; ``measured`` then says why.
    What the same rule finds under other conventions stands under their names.
    """
    return [
        {
            "id": claim.id,
            "where": claim.where,
            "paper": claim.says,
            "rule": claim.rule,
            "command": claim.command,
            **_found(claim, evidence),
            **{name: _found(claim, other) for name, other in (others or {}).items()},
        }
        for claim in claims
    ]


def _found(claim: PaperClaim, evidence: Evidence) -> dict[str, Any]:
    found = claim.judge(evidence)
    return {
        "measured": found.measured,
        "interval": None if found.low is None else [found.low, found.high],
        "outcome": found.outcome,
        "reproduced": {REPRODUCED: True, NOT_REPRODUCED: False, NOT_DECIDABLE: None}[found.outcome],
    }


def finding(row: Mapping[str, Any], convention: str = DEFAULT) -> Mapping[str, Any]:
    """Return what was found of a claim under a convention."""
    found: Mapping[str, Any] = row if convention == DEFAULT else row[convention]
    return found


def summary(rows: Sequence[dict[str, Any]], convention: str = DEFAULT) -> str:
    """Return one line: how many claims have which outcome."""
    count = Counter(finding(row, convention)["outcome"] for row in rows)
    outcomes = (REPRODUCED, NOT_REPRODUCED, NOT_DECIDABLE)
    return f"{len(rows)} claims: " + ", ".join(f"{count[name]} {name}" for name in outcomes)


def _shown(found: Mapping[str, Any], first: Mapping[str, Any] | None) -> list[str]:
    """Return two cells: what was measured, unless it is what `first` has, and the outcome."""
    measured, interval = found["measured"], found["interval"]
    if interval is not None:
        measured += f" ({interval[0]:.2f} to {interval[1]:.2f})"
    if first is not None and all(found[key] == first[key] for key in ("measured", "interval")):
        measured = "the same"
    return [measured, found["outcome"] if found["reproduced"] else f"**{found['outcome']}**"]


def markdown(rows: Sequence[dict[str, Any]], others: Sequence[str] = ()) -> str:
    """Return the scoreboard as a Markdown table: two columns for each convention."""
    names = [DEFAULT, *(name for name in others if rows and name in rows[0])]
    head = ["claim", "where", "the paper", "rule"]
    head += [f"{name}: {what}" for name in names for what in ("measured", "outcome")]
    head += ["cause"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for row in rows:
        cells = [row[key] for key in ("id", "where", "paper", "rule")]
        for name in names:
            cells += _shown(finding(row, name), None if name == DEFAULT else row)
        cells.append(cause_text(row.get("cause")))
        lines.append("| " + " | ".join(str(cell).replace("|", "/") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
