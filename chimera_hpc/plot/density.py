"""Classes of sigma_l from its density, and along a parameter (paper fig. 23)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers

_SYMBOL = r"$\sigma_1$"
_CUT: dict[str, Any] = {"color": "#555555", "linestyle": "--", "linewidth": 0.8}


@dataclass(frozen=True)
class Density:
    """Values (n,), their density on a grid (g,), the borders of classes, and their names."""

    values: ArrayLike
    grid: ArrayLike
    density: ArrayLike
    cuts: ArrayLike
    names: Sequence[str]
    labels: ArrayLike
    """(n,) positions in `names`"""


def sigma_l_figure(data: FigureInput) -> Figure | None:
    """Draw histogram and density of sigma_1 with its cuts, and its classes (paper fig. 23)."""
    entry = data.curves.get("sigma-l")
    if entry is None or data.only_axis is None:
        return None
    label, x = data.only_axis
    keys = ("grid", "density", "cuts", "names", "labels")
    made = Density(numbers(entry["values"]), **{key: entry[key] for key in keys})
    return density_classes(made, x[np.array(entry["cell_of_run"])], label=label)


@style.styled
def density_classes(made: Density, x: ArrayLike, *, label: str = "$P$") -> Figure:
    """Draw (a) histogram, density and cuts, (b) every run at its x (n,) by class."""
    figure, panels = style.new_panels(2, style.PAGE, 2.7)
    left, right = panels
    _draw_histogram(left, made)
    position, data = np.asarray(x, float), np.asarray(made.values, float)
    for i, name in enumerate(made.names):
        chosen = np.asarray(made.labels) == i
        look = {"marker": "D", "alpha": 0.7}
        style.scatter_class(right, position[chosen], data[chosen], name, 14.0, **look)
    for cut in np.asarray(made.cuts, float):
        right.axhline(cut, **_CUT)
    style.set_ticks(right.xaxis, position)
    right.set_xlabel(label)
    right.set_ylabel(_SYMBOL)
    style.letter(panels)
    figure.legend(loc="outside upper center", ncols=len(made.names) + 3)
    return figure


def _draw_histogram(axes: Axes, made: Density) -> None:
    data = np.asarray(made.values, float)
    known, colour = data[np.isfinite(data)], style.lighten(style.BLUE, 0.65)
    axes.hist(known, bins=50, density=True, color=colour, label="histogram")
    axes.plot(made.grid, made.density, color=style.RED, linewidth=1.3, label="kernel density")
    for i, cut in enumerate(np.asarray(made.cuts, float)):
        axes.axvline(cut, label="cut" if i == 0 else None, **_CUT)
    if known.min() >= 0.0:
        # The kernels reach below 0, the values do not.
        axes.set_xlim(left=0.0)
    axes.set_xlabel(_SYMBOL)
    axes.set_ylabel("density")
