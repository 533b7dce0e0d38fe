"""The error bar of a phase diagram: how often the cells keep their modal class (an audit)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from chimera_hpc.classify.resampling import FIRM
from chimera_hpc.plot import style

_HEIGHT = 0.75
"""Height of the panel, in inches."""


def add_kept_panel(
    figure: Figure, axes: Axes, x: ArrayLike, classes: Sequence[str | None], kept: ArrayLike
) -> None:
    """Add a panel below `axes` with a bar for each x (k,): how often the cell keeps its class.

    `kept` (k,) is the share of the resamplings of its seeds, NaN if there are too few seeds. A bar
    has the colour of the class. The dashed line is the level from which a class is firm.
    """
    values, shares = np.asarray(x, dtype=np.float64), np.asarray(kept, dtype=np.float64)
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + _HEIGHT)
    grid = figure.add_gridspec(2, 1, height_ratios=(height, _HEIGHT))
    axes.set_subplotspec(grid[0])
    panel = figure.add_subplot(grid[1], sharex=axes)
    panel.bar(
        values,
        shares,
        width=0.7 * np.diff(np.unique(values)).min(initial=np.ptp(values) or 1.0),
        color=[style.colour_of(name) for name in classes],
        linewidth=0.0,
    )
    panel.axhline(FIRM, color="#555555", linestyle="--", linewidth=0.7)
    panel.set_ylim(0.0, 1.05)
    panel.set_yticks([0.0, FIRM])
    panel.set_ylabel("class\nstays")
    panel.set_xlabel(axes.get_xlabel())
    axes.set_xlabel("")
    axes.tick_params(labelbottom=False)


def open_loose_cells(
    axes: Axes,
    parameters: Sequence[tuple[str, ArrayLike]],
    classes: Sequence[str | None],
    kept: ArrayLike,
) -> list[Line2D]:
    """Draw open markers for the cells that are not firm; return the entries of the legend.

    `parameters` are label and value (k,) of two parameters, `kept` (k,) is the share of the
    resamplings of a cell's seeds that keep its class.
    """
    loose = np.asarray(kept, dtype=np.float64) < FIRM
    x, y = (np.asarray(values, dtype=np.float64) for _, values in parameters)
    for name in dict.fromkeys(classes):
        mine = loose & np.array([other == name for other in classes])
        axes.scatter(
            *(x[mine], y[mine]),
            s=4.5,
            marker=style.marker_of(name),
            color="#ffffff",
            linewidths=0.0,
            zorder=3.0,
        )
    label = f"stays in < {FIRM:.0%}"
    return [Line2D([], [], ls="none", marker="o", fillstyle="none", color="#555555", label=label)]
