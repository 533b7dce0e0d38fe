"""An audit in words, for the terminal and the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chimera_hpc.classify.resampling import FIRM

HEAD = (
    *("computed again with", "labels changed", "95 % interval"),
    *("change of class fractions", "steps", "failed"),
)
_MOST_CELLS = 10
_MOST_POINTS = 20

Audit = Mapping[str, Any]


def audit_lines(audit: Audit) -> list[str]:
    """Return what an audit found: its sample, the table, the points that changed, the cells."""
    table = [HEAD, *audit_rows(audit)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    rows = [
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]
    return [sample_line(audit), *rows, *changed_lines(audit), *bootstrap_lines(audit)]


def audit_rows(audit: Audit) -> list[tuple[str, ...]]:
    """Return a row for each way of computing again, under `HEAD`."""
    return [
        (
            made["what"],
            f"{made['changed']} of {made['of']}",
            f"{made['low']:.2f} to {made['high']:.2f}",
            f"{made['total_variation']:.3f}",
            f"x {made['steps']:.2f}",
            ", ".join(f"{count} {name}" for name, count in made["failed"].items()) or "0",
        )
        for made in audit["ways"].values()
    ]


def sample_line(audit: Audit) -> str:
    """Return how many points were computed again, of what, and who labelled them."""
    pending = audit["total"] - audit["of"]
    rest = f" ({pending} more have none)" if pending else ""
    return (
        f"{audit['points']} of {audit['of']} points with a result{rest} computed again, "
        f"labelled by {audit['labels']}"
    )


def changed_lines(audit: Audit) -> list[str]:
    """Return a line for each point with another label, or none, in one of the ways."""
    lines = [
        f"{place_words(one['place'])}: {one['label']}; "
        + ", ".join(f"{way} {one[way] or 'failed'}" for way in audit["ways"])
        for one in audit["changed"][:_MOST_POINTS]
    ]
    more = len(audit["changed"]) - len(lines)
    return [*lines, f"and {more} more points" if more else ""][: len(lines) + bool(more)]


def bootstrap_lines(audit: Audit) -> list[str]:
    """Return how many cells keep their modal class, and which do not."""
    boot = audit["bootstrap"]
    lines = []
    if boot["cells"]:
        lines.append(
            f"{boot['cells'] - len(boot['loose'])} of {boot['cells']} cells keep their modal class "
            f"in at least {FIRM:.0%} of {boot['draws']} resamplings of their seeds "
            f"(mean {boot['mean']:.3f})"
        )
    if boot["loose"]:
        some = [
            f"{place_words(one['place'])} ({one['class']} {one['kept']:.2f})"
            for one in boot["loose"][:_MOST_CELLS]
        ]
        more = len(boot["loose"]) - len(some)
        lines.append(f"below: {'; '.join(some)}" + (f"; and {more} more" if more else ""))
    if boot["single"]:
        lines.append(f"no bootstrap of {boot['single']} cells: they have a single run")
    return lines


def place_words(place: Mapping[str, float]) -> str:
    """Return where a point or a cell lies: ``P = 9, Q = 3``; the only cell has no place."""
    return ", ".join(f"{name} = {value}" for name, value in place.items()) or "all"
