"""Runs at other parameters over the classes of a finished sweep.

Paper fig. 7 (parameter b) and fig. 8 (epsilon).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers
from chimera_hpc.plot.projections import LABELS

_PALE = 0.72
"""Share of white in the colours of the classes."""


@dataclass(frozen=True)
class Diamonds:
    """One panel: mean triplets (k, 3), one for each value (k,) of the parameter."""

    title: str
    triplets: ArrayLike
    values: ArrayLike


def atlas_figure(data: FigureInput) -> Figure | None:
    """Draw the mean of each cell as a diamond over the classes of the atlas (paper figs. 7, 8).

    There is one panel for each value of the first axis, and colours show the second axis. With one
    axis, there is one panel, and colours show this axis.
    """
    entry = data.curves.get("atlas")
    if entry is None or not data.axes:
        return None
    *first, (parameter, colours) = data.axes[:2]
    groups = [("", np.full(len(colours), True))]
    if first:
        label, values = first[0]
        each = dict.fromkeys(values.tolist())
        groups = [(f"{label.rstrip('$')} = {value}$", values == value) for value in each]
    cells = next(iter(entry["judges"].values()))
    panels = []
    for title, group in groups:
        chosen = [i for i in np.flatnonzero(group) if cells[i]["triplet"] is not None]
        triplets = numbers([cells[i]["triplet"] for i in chosen]).reshape(-1, 3)
        panels.append(Diamonds(title, triplets, colours[chosen]))
    ground = entry["background"]
    names = ground["names"]
    return atlas(ground["triplets"], ground["labels"], names, panels, parameter=parameter)


@style.styled
def atlas(
    triplets: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str],
    panels: Sequence[Diamonds],
    *,
    parameter: str = r"$\epsilon$",
    plane: tuple[int, int] = (0, 1),
) -> Figure:
    """Draw the classes of triplets (n, 3) in light colours, and diamonds coloured by a parameter.

    The larger the value, the darker the diamond; all panels share one colour scale.
    """
    figure, axes = style.new_panels(len(panels), style.PAGE + 0.6, 2.75, sharex=True, sharey=True)
    every = np.concatenate([np.ravel(np.asarray(panel.values, float)) for panel in panels])
    # From a light yellow that still shows on white to nearly black.
    colours = LinearSegmentedColormap.from_list(
        "light_to_dark", colormaps["inferno_r"](np.linspace(0.08, 0.95, 256))
    )
    x, y = plane
    points, label = np.asarray(triplets, float), np.asarray(labels)
    for frame, panel in zip(axes, panels, strict=True):
        for i, name in enumerate(names):
            chosen = points[label == i]
            pale = style.lighten(style.colour_of(name), _PALE)
            style.scatter_class(frame, chosen[:, x], chosen[:, y], name, 12.0, color=pale)
        above = np.asarray(panel.triplets, float).reshape(-1, 3)
        marks = frame.scatter(
            above[:, x],
            above[:, y],
            c=np.asarray(panel.values, float),
            vmin=every.min(),
            vmax=every.max(),
            s=30.0,
            marker="D",
            cmap=colours,
            edgecolors="#444444",
            linewidths=0.4,
            zorder=3.0,
        )
        frame.set_title(panel.title)
        frame.set_xlabel(LABELS[x])
    axes[0].set_ylabel(LABELS[y])
    style.letter(axes)
    figure.colorbar(marks, ax=axes, label=parameter, fraction=0.03, pad=0.01)
    handles = style.class_handles(names)
    for handle in handles:
        handle.set_color(style.lighten(str(handle.get_color()), _PALE))
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure
