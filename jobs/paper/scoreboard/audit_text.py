"""The audit of the labels as Markdown: a table of jobs, and the cells where a label changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

HEADS = {
    "tighter": "100x tighter tolerance",
    "moved": "moved by 1e-13 (control)",
    "late": "t = 5000",
}
_NOT_PLACES = {"votes", "class", "audited", "stays", "low", "high", *HEADS}


def audit_text(audit: Mapping[str, Any]) -> str:
    """Return the two tables."""
    tables = (jobs_table(audit), chimeras_line(audit), _CELLS, cells_table(audit))
    return "\n".join((_INTRODUCTION, *tables))


_INTRODUCTION = """\
A random 2 % of all points is run again at 100 times tighter tolerance, with the initial state moved
by 1e-13 at the old tolerance (the control: what chaos alone does to a label), and to t = 5000.
Given are the labels that changed with their Wilson 95 % interval, and the net change of the class
fractions. The last column resamples the seeds of every cell 1000 times: the mean probability that
its modal class comes out the same. Each job's figures/audit shows this cell by cell beside its
phase diagram; results.json holds every cell, of the basins those with an audited point.
"""
_CELLS = """\
Cells where a label changed: how many points of the cell were audited, what changed in each way of
running again (the change of the cell's class fractions is that number over the audited points), and
the bootstrap of its modal class. In all other cells with an audited point nothing changed.
"""


def jobs_table(audit: Mapping[str, Any]) -> str:
    """Return one row a job."""
    lines = [_row(["job", "points", *HEADS.values(), "modal classes that stay"])]
    lines.append("|" + "---|" * 6)
    for name, entry in audit.items():
        boot = entry["bootstrap"]
        stays = (
            f"{boot['mean']:.3f} over {boot['cells']} cells, {boot['below_95']} below 0.95"
            if boot["cells"]
            else ""
        )
        cells = [_counts(entry[way]) if way in entry else "" for way in HEADS]
        points = f"{entry['points']} of {entry['of']}"
        lines.append(_row([name, points, *cells, stays]))
    return "\n".join(lines) + "\n"


def chimeras_line(audit: Mapping[str, Any]) -> str:
    """Return how many audited chimeras are something else after each way of running again."""
    entries = [entry for entry in audit.values() if "late" in entry]
    total = sum(_chimeras(entry["classes"]) for entry in entries)
    left = [
        f"{sum(_chimeras(entry[way]['moves']) for entry in entries)} ({head})"
        for way, head in HEADS.items()
    ]
    return f"Of {total} audited chimeras these had another class: {', '.join(left)}.\n"


def _chimeras(counts: Mapping[str, int]) -> int:
    """Add up the chimeras among classes, or among moves from one class to another."""
    return sum(count for name, count in counts.items() if name.startswith("chimera"))


def cells_table(audit: Mapping[str, Any]) -> str:
    """Return one row for each cell where the label of an audited point changed."""
    lines = [_row(["job", "cell", "audited", *HEADS.values(), "modal class, stays with"])]
    lines.append("|" + "---|" * 7)
    for name, entry in audit.items():
        for cell in entry["cells"]:
            if not any(cell[way]["changed"] for way in HEADS if way in cell):
                continue
            place = ", ".join(
                f"{key} = {value:.4g}" for key, value in cell.items() if key not in _NOT_PLACES
            )
            ways = [_moves(cell[way]) if way in cell else "" for way in HEADS]
            lines.append(
                _row([name, place, str(cell["audited"]), *ways, f"{cell['class']}, {_stays(cell)}"])
            )
    return "\n".join(lines) + "\n"


def _stays(cell: Mapping[str, Any]) -> str:
    return f"{cell['stays']:.3f}" if "stays" in cell else ""


def _counts(made: Mapping[str, Any]) -> str:
    net = ", ".join(f"{name} {change:+.3f}" for name, change in made["net"].items())
    return f"{made['changed']} ({made['low']:.2f} to {made['high']:.2f})" + (net and f": {net}")


def _moves(made: Mapping[str, Any]) -> str:
    return ", ".join(f"{count} {move}" for move, count in made["moves"].items()) or "0"


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"
