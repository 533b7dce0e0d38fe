"""The scoreboard: claims read from jobs/paper/claims.toml, judged by rules, written as tables."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from scoreboard.evidence import Evidence, Missing
from scoreboard.rules import NOT_DECIDABLE, NOT_REPRODUCED, REPRODUCED, RULES, Finding

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


def scoreboard(claims: Iterable[PaperClaim], evidence: Evidence) -> list[dict[str, Any]]:
    """Judge every claim: rows as results.json holds them under ``claims``.

    ``reproduced`` is true, false, or None where it can't be decided; ``measured`` then says why.
    """
    answer = {REPRODUCED: True, NOT_REPRODUCED: False, NOT_DECIDABLE: None}
    rows = []
    for claim in claims:
        found = claim.judge(evidence)
        interval = None if found.low is None else [found.low, found.high]
        rows.append(
            {
                "id": claim.id,
                "where": claim.where,
                "paper": claim.says,
                "rule": claim.rule,
                "command": claim.command,
                "measured": found.measured,
                "interval": interval,
                "outcome": found.outcome,
                "reproduced": answer[found.outcome],
            }
        )
    return rows


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """Return one line: how many claims have which outcome."""
    count = Counter(row["outcome"] for row in rows)
    outcomes = (REPRODUCED, NOT_REPRODUCED, NOT_DECIDABLE)
    return f"{len(rows)} claims: " + ", ".join(f"{count[name]} {name}" for name in outcomes)


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Return the scoreboard as a Markdown table."""
    head = ["claim", "where", "the paper", "rule", "measured", "95 % interval", "outcome"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for row in rows:
        interval = row["interval"]
        ends = "" if interval is None else f"{interval[0]:.2f} to {interval[1]:.2f}"
        outcome = row["outcome"] if row["reproduced"] else f"**{row['outcome']}**"
        cells = [
            *(row[key] for key in ("id", "where", "paper", "rule", "measured")),
            *(ends, outcome),
        ]
        lines.append("| " + " | ".join(str(cell).replace("|", "/") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
