"""How many classes there are: gap statistic, silhouette and stability against the number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers


def class_number_figure(data: FigureInput) -> Figure | None:
    """Draw the three measures of the number of classes."""
    entry = data.curves.get("number-of-classes")
    return None if entry is None else class_number(entry)


@style.styled
def class_number(entry: Mapping[str, Any]) -> Figure:
    """Draw gap, silhouette and stability (k,) against k = 1, 2, ...; a line marks each answer."""
    figure, axes = style.new_panels(3, style.PAGE, 2.4)
    curves = {name: numbers(entry[name.split()[0]]) for name in entry["by"]}
    for frame, (name, values) in zip(axes, curves.items(), strict=True):
        k = np.arange(1, len(values) + 1)
        error = numbers(entry["gap_error"]) if name == "gap statistic" else None
        frame.errorbar(k, values, error, marker="o", markersize=3.0, color=style.BLUE)
        frame.axvline(entry["by"][name], color=style.RED, linestyle="--", linewidth=0.9)
        frame.set_title(f"{name}: {entry['by'][name]}")
        frame.set_xlabel("number of classes $k$")
        style.set_ticks(frame.xaxis, k)
    style.letter(axes)
    return figure
