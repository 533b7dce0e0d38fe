"""The audit of the labels as Markdown: a table of jobs, and the points whose label changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chimera_hpc.classify.resampling import DRAWS, FIRM
from chimera_hpc.reduction.audit_text import place_words

HEADS = {
    "tighter": "100x tighter tolerance",
    "nudged": "moved by 1e-13 (control)",
    "longer": "t = 5000",
}


def audit_text(audit: Mapping[str, Any]) -> str:
    """Return what is done, and the two tables."""
    return f"{_INTRODUCTION}\n{audit_tables(audit)}"


def audit_tables(audit: Mapping[str, Any]) -> str:
    """Return the two tables."""
    return "\n".join((jobs_table(audit), chimeras_line(audit), _POINTS, points_table(audit)))


_INTRODUCTION = f"""\
2 % of all points, spread over the cells, are run again at 100 times tighter tolerance, with the
initial state moved by 1e-13 at the old tolerance (the control: how many labels change by chaos
alone), and to t = 5000. The table has the labels that changed with their Wilson 95 % interval, and
the net change of the class fractions. The last column resamples the seeds of every cell {DRAWS}
times: the mean probability that its modal class comes out the same. The job's results.json holds
the bootstrap of every cell.
"""
_POINTS = """\
Points whose label changed in at least one of the three repetitions:
"""


def jobs_table(audit: Mapping[str, Any]) -> str:
    """Return one row a job."""
    lines = [_row(["job", "points", *HEADS.values(), "modal classes that stay"])]
    lines.append("|" + "---|" * 6)
    for name, entry in audit.items():
        boot, ways = entry["bootstrap"], entry["ways"]
        below = len(boot["loose"])
        stays = (
            f"{boot['mean']:.3f} over {boot['cells']} cells, {below} below {FIRM}"
            if boot["cells"]
            else ""
        )
        cells = [_counts(ways[way]) if way in ways else "" for way in HEADS]
        lines.append(_row([name, f"{entry['points']} of {entry['total']}", *cells, stays]))
    return "\n".join(lines) + "\n"


def chimeras_line(audit: Mapping[str, Any]) -> str:
    """Return how many audited chimeras are something else after each way of running again."""
    entries = [entry for entry in audit.values() if "longer" in entry["ways"]]
    total = sum(_chimeras(entry["classes"]) for entry in entries)
    left = [
        f"{sum(_chimeras(entry['ways'][way]['moves']) for entry in entries)} ({head})"
        for way, head in HEADS.items()
    ]
    return f"Of {total} audited chimeras these had another class: {', '.join(left)}.\n"


def _chimeras(counts: Mapping[str, int]) -> int:
    """Add up the chimeras among classes, or among moves from one class to another."""
    return sum(count for name, count in counts.items() if name.startswith("chimera"))


def points_table(audit: Mapping[str, Any]) -> str:
    """Return one row for each audited point whose label changed, or that failed."""
    lines = [_row(["job", "point", "class", *HEADS.values()]), "|" + "---|" * 6]
    for name, entry in audit.items():
        for point in entry["changed"]:
            labels = ["" if way not in point else point[way] or "failed" for way in HEADS]
            lines.append(_row([name, place_words(point["place"]), point["label"], *labels]))
    return "\n".join(lines) + "\n"


def _counts(made: Mapping[str, Any]) -> str:
    net = ", ".join(f"{name} {change:+.3f}" for name, change in made["net"].items())
    return f"{made['changed']} ({made['low']:.2f} to {made['high']:.2f})" + (net and f": {net}")


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"
