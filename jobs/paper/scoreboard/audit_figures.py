"""The audit drawn beside the phase diagram of each job: figures/audit.png and .pdf."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from chimera_hpc.plot.style import save
from scoreboard.audit_plot import Firmness, audit_against, audit_map
from scoreboard.audit_text import HEADS
from scoreboard.cells import share_of, total_variation


def draw_audit(folder: Path, audit: Mapping[str, Any]) -> list[Path]:
    """Write the figure of each job with one or two free axes; return the files."""
    written: list[Path] = []
    for name, entry in audit.items():
        figure = audit_figure(entry)
        if figure is not None:
            place = folder / name / "figures"
            place.mkdir(parents=True, exist_ok=True)
            written.extend(save(figure, place / "audit"))
    return written


def audit_figure(entry: Mapping[str, Any]) -> Figure | None:
    """Return the figure of one job's audit; None without one or two free axes."""
    cells, axes = entry["cells"], entry["axes"]
    if not cells or len(axes) not in (1, 2):
        return None
    values = [np.array([cell[axis["name"]] for cell in cells], dtype=np.float64) for axis in axes]
    symbols = [axis["symbol"] for axis in axes]
    found = Firmness(
        classes=[cell["class"] for cell in cells],
        share=np.array([share_of(cell["votes"], cell["class"]) for cell in cells]),
        low=_column(cells, "low"),
        high=_column(cells, "high"),
        stays=_column(cells, "stays"),
        changes={
            head: np.array([_changed(cell.get(way)) for cell in cells])
            for way, head in HEADS.items()
            if way in entry
        },
    )
    if len(axes) == 1:
        return audit_against(values[0], found, label=symbols[0])
    return audit_map(values[0], values[1], found, labels=(symbols[0], symbols[1]))


def _column(cells: Sequence[Mapping[str, Any]], key: str) -> Any:
    return np.array([cell.get(key, np.nan) for cell in cells], dtype=np.float64)


def _changed(made: Mapping[str, Any] | None) -> float:
    return np.nan if made is None else total_variation(made["net"])
