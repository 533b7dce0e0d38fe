"""The modal class along a parameter and over the plane of two (paper, panels c)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.audit import add_kept_panel, open_loose_cells
from chimera_hpc.plot.figure_input import FigureInput

Array = NDArray[np.float64]

_WHOLE = 90.0
"""Area of a disc that stands for all votes of a cell, in points squared."""
_SHARES = (0.1, 0.5, 1.0)

Classes = Sequence[str | None]
Votes = Sequence[Mapping[str, int]]
Parameters = Sequence[tuple[str, ArrayLike]]
"""One or two parameters that vary: label, and value (k,) in each cell."""


def modal_classes_figure(data: FigureInput, n_clusters: int) -> Figure | None:
    """Draw the modal class against the one parameter that varies, or over the plane of two."""
    classes = data.classes(n_clusters)
    if len(data.axes) not in (1, 2) or not any(classes):
        return None
    kept = data.kept.get(n_clusters)
    return modal_classes(data.axes, classes, data.votes(n_clusters), kept, data.judged_elsewhere)


@style.styled
def modal_classes(
    parameters: Parameters,
    classes: Classes,
    votes: Votes = (),
    kept: ArrayLike | None = None,
    title: str = "",
) -> Figure:
    """Draw the modal class of each cell; arguments as in `draw_modal_classes`.

    `kept` (k,) is the share of resamplings that keep the class of a cell, see `plot.audit`.
    """
    size = (0.8, 2.3) if len(parameters) == 1 else (1.2, 3.2)
    figure, (axes,) = style.new_panels(1, style.COLUMN + size[0], size[1])
    draw_modal_classes(axes, parameters, classes, votes)
    axes.set_title(title)
    if len(parameters) == 2:
        loose = [] if kept is None else open_loose_cells(axes, parameters, classes, kept)
        style.add_class_legend(figure, filter(None, classes), loose)
        return figure
    style.add_legend(figure, vote_handles())
    if kept is not None:
        add_kept_panel(figure, axes, parameters[0][1], classes, kept)
    return figure


def draw_modal_classes(
    axes: Axes, parameters: Parameters, classes: Classes, votes: Votes = ()
) -> None:
    """Draw the modal class of each cell against one parameter, or over the plane of two."""
    if len(parameters) == 1:
        _draw_against(axes, *parameters[0], classes, votes)
    else:
        _draw_map(axes, parameters, classes)


def _draw_against(axes: Axes, label: str, x: ArrayLike, classes: Classes, votes: Votes) -> None:
    """Draw one row per class: a full marker for the modal class of each x (k,), discs for votes.

    The area of a disc is the share of the votes.
    """
    values = np.asarray(x, dtype=np.float64)
    voted = (name for vote in votes for name in vote)
    rows = _rows(style.in_order([*filter(None, classes), *voted]))
    for i, vote in enumerate(votes):
        total = max(sum(vote.values()), 1)
        for name, count in vote.items():
            axes.scatter(
                values[i],
                rows.index(name),
                s=_WHOLE * count / total,
                color=style.lighten(style.colour_of(name), 0.72),
                linewidths=0.0,
                zorder=1.0,
            )
    for row, name in enumerate(rows):
        chosen = values[[other == name for other in classes]]
        style.scatter_class(axes, chosen, np.full(len(chosen), row), name, 20.0, zorder=2.0)
    axes.set_yticks(range(len(rows)), [style.drawn(name) for name in rows])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    style.set_ticks(axes.xaxis, values, nbins=9, steps=[1, 2, 3, 5, 10])
    axes.set_xlabel(label)
    axes.grid(axis="y", color="#eeeeee")


def vote_handles() -> list[Line2D]:
    """Return the entries of a legend that explain the sizes of the discs."""
    look: dict[str, Any] = {"ls": "none", "marker": "o", "color": "#cccccc", "markeredgewidth": 0.0}
    return [
        Line2D([], [], markersize=(_WHOLE * share) ** 0.5, label=f"{share:.0%} of votes", **look)
        for share in _SHARES
    ]


def _draw_map(axes: Axes, parameters: Parameters, classes: Classes) -> None:
    """Fill the cell of each (x, y) with the colour of its class, and put the class's marker there.

    Steps of a parameter need not be equal: a cell reaches half-way to the next value.
    """
    (x_label, x), (y_label, y) = ((label, np.asarray(v, float)) for label, v in parameters)
    (across, x_edges), (up, y_edges) = _grid(x), _grid(y)
    names = style.in_order(filter(None, classes))
    shade = np.full((len(y_edges) - 1, len(x_edges) - 1), np.nan)
    for i, name in enumerate(names):
        chosen = np.array([other == name for other in classes])
        shade[up[chosen], across[chosen]] = i
    pale = ListedColormap([style.lighten(style.colour_of(name), 0.55) for name in names])
    axes.pcolormesh(x_edges, y_edges, shade, cmap=pale, vmin=-0.5, vmax=len(names) - 0.5)
    size = min(16.0, (160.0 / max(shade.shape)) ** 2)
    for name in names:
        chosen = np.array([other == name for other in classes])
        style.scatter_class(axes, x[chosen], y[chosen], name, size)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    style.set_ticks(axes.xaxis, x)
    style.set_ticks(axes.yaxis, y)


def _grid(values: Array) -> tuple[NDArray[np.int64], Array]:
    """Return for each cell its place along an axis, and the edges between places."""
    centres, place = np.unique(values, return_inverse=True)
    between = 0.5 * (centres[1:] + centres[:-1])
    ends = 2.0 * centres[[0, -1]] - between[[0, -1]]
    return place, np.concatenate([ends[:1], between, ends[1:]])


def _rows(names: list[str]) -> list[str]:
    """Put the runs that do not oscillate below the classes."""
    still = [name for name in names if name in ("steady", "no_window")]
    return [*still[::-1], *(name for name in names if name not in still)]
