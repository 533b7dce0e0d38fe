"""Classes of sigma_l from its density, and along a parameter (paper fig:sigmal)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from chimera_hpc.plot import style


@style.styled
def density_classes(
    values: ArrayLike,
    grid: ArrayLike,
    density: ArrayLike,
    cuts: ArrayLike,
    names: Sequence[str],
    x: ArrayLike,
    labels: ArrayLike,
    *,
    label: str = "$P$",
    symbol: str = r"$\sigma_1$",
) -> Figure:
    """Draw (a) histogram, density and cuts of values (n,), (b) every run at its x (n,) by class.

    `labels` (n,) index `names`; `density` is given on `grid`; `cuts` are the borders of classes.
    """
    figure = style.new_figure(style.PAGE, 2.7)
    left, right = figure.subplots(1, 2)
    _draw_histogram(left, values, grid, density, cuts, symbol)
    position, data = np.asarray(x, float), np.asarray(values, float)
    for i, name in enumerate(names):
        chosen = np.asarray(labels) == i
        right.scatter(
            position[chosen],
            data[chosen],
            s=14.0,
            marker="D",
            color=style.colour_of(name),
            alpha=0.7,
            linewidths=0.0,
            label=style.spoken(name),
        )
    for cut in np.asarray(cuts, float):
        right.axhline(cut, color="#555555", linestyle="--", linewidth=0.8)
    right.xaxis.set_major_locator(MaxNLocator(integer=bool(np.all(position == np.rint(position)))))
    right.set_xlabel(label)
    right.set_ylabel(symbol)
    style.letter([left, right])
    figure.legend(loc="outside upper center", ncols=len(names) + 3)
    return figure


def _draw_histogram(
    axes: Axes,
    values: ArrayLike,
    grid: ArrayLike,
    density: ArrayLike,
    cuts: ArrayLike,
    symbol: str,
) -> None:
    data = np.asarray(values, float)
    axes.hist(
        data[np.isfinite(data)],
        bins=50,
        density=True,
        color=style.lighten(style.BLUE, 0.65),
        label="histogram",
    )
    axes.plot(grid, density, color=style.RED, linewidth=1.3, label="kernel density")
    for i, cut in enumerate(np.asarray(cuts, float)):
        name = "cut" if i == 0 else None
        axes.axvline(cut, color="#555555", linestyle="--", linewidth=0.8, label=name)
    if np.nanmin(data) >= 0.0:
        # The kernels reach below 0, the values do not.
        axes.set_xlim(left=0.0)
    axes.set_xlabel(symbol)
    axes.set_ylabel("density")
