"""Chains of points: an order parameter and the class along the followed axis, both ways."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers

_LOOKS: dict[str, dict[str, Any]] = {
    "forward": {"color": style.BLUE, "marker": ">", "linestyle": "-"},
    "backward": {"color": style.RED, "marker": "<", "linestyle": "--"},
}
_SHIFT = {"forward": 0.16, "backward": -0.16}
_MOST_CELLS = 4


def hysteresis_figure(data: FigureInput) -> Figure | None:
    """Draw the chains of the first cells of the other axes."""
    return hysteresis(data.chains["chains"], data.chains["hysteresis"]) if data.chains else None


@style.styled
def hysteresis(chains: Sequence[Mapping[str, Any]], cells: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw one column per cell: order parameter above, class of each run below.

    Lines are medians over the chains of a cell, bands their range. Grey bands are where the order
    parameter has its largest step. Entries as in results.json.
    """
    shown = cells[:_MOST_CELLS]
    figure = style.new_figure(max(style.COLUMN + 0.4, 2.2 * len(shown)), 3.6)
    rows = figure.subplots(2, len(shown), squeeze=False, sharex="col", height_ratios=(3, 2))
    names = style.in_order({name for chain in chains for name in chain["classes"] if name})
    for upper, lower, cell in zip(rows[0], rows[1], shown, strict=True):
        place = {k: v for k, v in cell.items() if k not in ("along", "order", *_LOOKS)}
        mine = [chain for chain in chains if place.items() <= chain.items()]
        _draw_order(upper, cell, mine)
        _draw_classes(lower, mine, names)
        upper.set_title(", ".join(f"{name} = {value:.4g}" for name, value in place.items()))
        lower.set_xlabel(style.plain(cell["along"]))
    rows[0, 0].set_ylabel(style.drawn(cells[0]["order"]))
    ways = [way for way in _LOOKS if any(chain["direction"] == way for chain in chains)]
    handles = [Line2D([], [], markersize=4.0, label=way, **_LOOKS[way]) for way in ways]
    style.add_legend(figure, handles)
    return figure


def _draw_order(axes: Axes, cell: Mapping[str, Any], chains: Sequence[Mapping[str, Any]]) -> None:
    for way, look in _LOOKS.items():
        mine = [chain for chain in chains if chain["direction"] == way]
        if not mine:
            continue
        x, order = numbers(mine[0]["values"]), np.stack([numbers(each["order"]) for each in mine])
        masked = np.ma.masked_invalid(order)
        axes.fill_between(
            x, masked.min(axis=0), masked.max(axis=0), color=look["color"], alpha=0.15, linewidth=0
        )
        middle = [
            float(np.nanmedian(column)) if np.isfinite(column).any() else np.nan
            for column in order.T
        ]
        axes.plot(x, middle, linewidth=0.9, markersize=3.0, **look)
        if cell[way]["step"] is not None:
            axes.axvspan(*cell[way]["step"]["interval"], color=look["color"], alpha=0.08)


def _draw_classes(axes: Axes, chains: Sequence[Mapping[str, Any]], names: Sequence[str]) -> None:
    for chain in chains:
        values, shift = numbers(chain["values"]), _SHIFT[chain["direction"]]
        for row, name in enumerate(names):
            x = values[[other == name for other in chain["classes"]]]
            style.scatter_class(axes, x, np.full(len(x), row + shift), name, 14.0)
    axes.set_yticks(range(len(names)), [style.drawn(name) for name in names])
    axes.set_ylim(-0.6, max(len(names), 1) - 0.4)
    axes.grid(axis="y", color="#eeeeee")
