"""Decided cells and the boundaries between their classes, with error bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers

Array = NDArray[np.float64]
Cells = Sequence[Mapping[str, Any]]


def boundaries_figure(data: FigureInput) -> Figure | None:
    """Draw the cells of a sweep with [decide] along its axis, or over the plane of two."""
    if not data.decided or len(data.axes) not in (1, 2):
        return None
    axes = [(label, np.asarray(values, float)) for label, values in data.axes]
    cells = data.decided["decide"]["cells"]
    places = {
        name: k
        for name in cells[0]
        for k, (_, values) in enumerate(axes)
        if isinstance(cells[0][name], int | float)
        and np.array_equal(values, numbers([cell[name] for cell in cells]))
    }
    judge = f"by the {data.decided['decide']['judge']}"
    return boundaries(axes, cells, data.decided["boundaries"], places, judge)


@style.styled
def boundaries(
    axes: Sequence[tuple[str, Array]],
    cells: Cells,
    found: Cells,
    places: Mapping[str, int],
    title: str = "",
) -> Figure:
    """Draw cells and boundaries.

    axes: one or two parameters: label, and value (n_cells,) in each cell.
    cells, found: as in results.json. Open markers are cells whose class is not decided.
    places: which of `axes` a name of a parameter is.
    """
    figure, (panel,) = style.new_panels(1, style.COLUMN + 1.2, 2.6 if len(axes) == 1 else 3.2)
    x = axes[0][1]
    y = numbers([cell["share"] for cell in cells]) if len(axes) == 1 else axes[1][1]
    if len(axes) == 1:
        interval = numbers([cell["interval"] for cell in cells])
        panel.vlines(x, interval[:, 0], interval[:, 1], color=style.GREY, lw=0.8, zorder=1.0)
        panel.set_ylim(0.0, 1.05)
    _draw_cells(panel, x, y, cells)
    for boundary in found:
        _draw_boundary(panel, boundary, places, len(axes))
    style.set_ticks(panel.xaxis, x)
    panel.set_title(style.plain(title))
    panel.set_xlabel(axes[0][0])
    panel.set_ylabel("share of the class" if len(axes) == 1 else axes[1][0])
    style.add_class_legend(figure, filter(None, (cell["class"] for cell in cells)), [])
    return figure


def _draw_cells(panel: Axes, x: Array, y: Array, cells: Cells) -> None:
    for name in style.in_order({cell["class"] for cell in cells if cell["class"]}):
        mine = np.array([cell["class"] == name for cell in cells])
        decided = np.array([cell["decided"] for cell in cells])
        style.scatter_class(panel, x[mine & decided], y[mine & decided], name, 12.0)
        open_ = mine & ~decided
        look: dict[str, Any] = {
            "marker": style.marker_of(name),
            "edgecolors": style.colour_of(name),
        }
        panel.scatter(x[open_], y[open_], s=12.0, facecolors="white", linewidths=0.8, **look)


def _draw_boundary(
    panel: Axes, boundary: Mapping[str, Any], places: Mapping[str, int], n_axes: int
) -> None:
    """Draw a band across the panel, or over a plane an error bar along the boundary's axis."""
    low, high = boundary["interval"]
    if n_axes == 1:
        panel.axvspan(low, high, color=style.TEAL, alpha=0.3, lw=0.0)
        panel.axvline(boundary["at"], color=style.TEAL, lw=0.8)
        return
    axis = places.get(boundary["axis"])
    across = [name for name in boundary if name in places and places[name] != axis]
    if axis is None or not across:
        return
    other = boundary[across[0]]
    at, half = boundary["at"], (high - low) / 2
    look: dict[str, Any] = {"color": style.TEAL, "lw": 1.0, "capsize": 2.0, "zorder": 3.0}
    if axis == 0:
        panel.errorbar(at, other, xerr=half, **look)
    else:
        panel.errorbar(other, at, yerr=half, **look)
