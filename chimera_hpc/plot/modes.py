"""The modal class along a parameter and over the plane (P, Q) (paper, panels c)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from chimera_hpc.plot import style


@style.styled
def class_against(
    x: ArrayLike,
    classes: Sequence[str | None],
    votes: Sequence[Mapping[str, int]] = (),
    *,
    label: str = "$P$",
) -> Figure:
    """Draw the modal class against a parameter; arguments as in `draw_class_against`."""
    figure = style.new_figure(style.COLUMN + 0.8, 2.3)
    draw_class_against(figure.subplots(), x, classes, votes, label=label)
    return figure


def draw_class_against(
    axes: Axes,
    x: ArrayLike,
    classes: Sequence[str | None],
    votes: Sequence[Mapping[str, int]] = (),
    *,
    label: str = "$P$",
) -> None:
    """Put one row a class: a full marker for the modal class of each x (k,), faint discs for votes.

    The area of a disc is the share of the votes.
    """
    values = np.asarray(x, dtype=np.float64)
    seen = [name for name in classes if name is not None]
    rows = _rows(style.in_order([*seen, *(name for vote in votes for name in vote)]))
    for i, vote in enumerate(votes):
        total = max(sum(vote.values()), 1)
        for name, count in vote.items():
            axes.scatter(
                values[i],
                rows.index(name),
                s=90.0 * count / total,
                color=style.lighten(style.colour_of(name), 0.72),
                linewidths=0.0,
                zorder=1.0,
            )
    for row, name in enumerate(rows):
        chosen = values[[other == name for other in classes]]
        axes.scatter(
            chosen,
            np.full(len(chosen), row),
            s=20.0,
            marker=style.marker_of(name),
            color=style.colour_of(name),
            linewidths=0.0,
            label=style.spoken(name),
            zorder=2.0,
        )
    axes.set_yticks(range(len(rows)), [style.spoken(name) for name in rows])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 3, 5, 10], integer=_whole(values)))
    axes.set_xlabel(label)
    axes.grid(axis="y", color="#eeeeee")


@style.styled
def class_map(
    x: ArrayLike,
    y: ArrayLike,
    classes: Sequence[str | None],
    *,
    labels: tuple[str, str] = ("$P$", "$Q$"),
) -> Figure:
    """Draw the modal class over a plane of two parameters; arguments as in `draw_class_map`."""
    figure = style.new_figure(style.COLUMN + 1.2, 3.2)
    axes = figure.subplots()
    draw_class_map(axes, x, y, classes, labels=labels)
    style.add_class_legend(figure, (name for name in classes if name is not None))
    return figure


def draw_class_map(
    axes: Axes,
    x: ArrayLike,
    y: ArrayLike,
    classes: Sequence[str | None],
    *,
    labels: tuple[str, str] = ("$P$", "$Q$"),
) -> None:
    """Put one marker for each cell (x, y), coloured and shaped by its class."""
    horizontal, vertical = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    for name in style.in_order(name for name in classes if name is not None):
        chosen = np.array([other == name for other in classes])
        axes.scatter(
            horizontal[chosen],
            vertical[chosen],
            s=16.0,
            marker=style.marker_of(name),
            color=style.colour_of(name),
            linewidths=0.0,
            label=style.spoken(name),
        )
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.xaxis.set_major_locator(MaxNLocator(integer=_whole(horizontal)))
    axes.yaxis.set_major_locator(MaxNLocator(integer=_whole(vertical)))


def _rows(names: list[str]) -> list[str]:
    """Put the runs that do not oscillate below the classes."""
    still = [name for name in names if name in ("steady", "no_window")]
    return [*still[::-1], *(name for name in names if name not in still)]


def _whole(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    return bool(np.all(values == np.rint(values)))
