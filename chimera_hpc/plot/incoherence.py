"""Strength of incoherence against a parameter (paper fig. 21, fig. 22)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers
from chimera_hpc.plot.raster import Raster, close_up
from chimera_hpc.plot.spacetime import draw_raster

_KINDS = (("SI = 0", style.RED), ("0 < SI < 1", style.BLUE), ("SI = 1", style.BLACK))


def incoherence_figure(data: FigureInput) -> Figure | None:
    """Draw the median SI for each threshold, and the last run to show (fig. 21)."""
    entry = data.curves.get("incoherence")
    if entry is None or not entry["deltas"] or data.only_axis is None:
        return None
    label, x = data.only_axis
    panels = [
        Strengths(
            rf"$\delta$ = {made['delta']:g}", x, numbers([row["median"] for row in made["rows"]])
        )
        for made in entry[entry["unit"]]["by_delta"]
    ]
    dynamics, signals = None, "nodes"
    if data.shown:
        dynamics, signals = close_up(data.shown[-1].t, data.shown[-1].u), data.shown[-1].signals
    return incoherence(panels, label=label, dynamics=dynamics, signals=signals)


def sensitivity_figure(data: FigureInput) -> Figure | None:
    """Draw the mean SI over the parameter and the threshold."""
    entry = data.curves.get("incoherence")
    if entry is None or data.only_axis is None:
        return None
    label, x = data.only_axis
    curve = entry["range"]["curve"]
    strength = numbers(curve["mean"])
    return incoherence_sensitivity(x, curve["delta"], strength, entry["deltas"], label=label)


@dataclass(frozen=True)
class Strengths:
    """SI (k,) for each value of the parameter (k,), all with one threshold."""

    title: str
    x: ArrayLike
    strength: ArrayLike


@style.styled
def incoherence(
    panels: Sequence[Strengths],
    *,
    label: str = "$P$",
    dynamics: Raster | None = None,
    signals: str = "nodes",
) -> Figure:
    """Draw SI as squares: red at 0, blue between, black at 1; and, if given, one run."""
    count = len(panels) + (dynamics is not None)
    figure, axes = style.new_panels(count, max(style.COLUMN + 0.6, 2.5 * count), 2.6)
    for frame, panel in zip(axes, panels, strict=False):
        _draw_strength(frame, panel, label)
    axes[0].set_ylabel("strength of incoherence SI")
    if dynamics is not None:
        image = draw_raster(axes[-1], dynamics, float(np.nanmax(np.abs(dynamics.values))))
        axes[-1].set_xlabel("time $t$")
        axes[-1].set_ylabel(style.signal_label(signals))
        figure.colorbar(image, ax=axes[-1], label="$u_i(t)$")
    style.letter(axes)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=3)
    return figure


def _draw_strength(axes: Axes, panel: Strengths, label: str) -> None:
    x, strength = np.asarray(panel.x, float), np.asarray(panel.strength, float)
    kind = np.where(strength <= 0.0, 0, np.where(strength >= 1.0, 2, 1))
    for i, (name, colour) in enumerate(_KINDS):
        chosen = kind == i
        look = {"marker": "s", "color": colour, "label": name}
        style.scatter_class(axes, x[chosen], strength[chosen], name, 16.0, **look)
    axes.set_ylim(-0.06, 1.06)
    style.set_ticks(axes.xaxis, x, nbins=7, steps=[1, 2, 3, 4, 5, 10])
    axes.set_xlabel(label)
    axes.set_title(panel.title)


@style.styled
def incoherence_sensitivity(
    x: ArrayLike, delta: ArrayLike, strength: ArrayLike, marks: Sequence[float], *, label: str
) -> Figure:
    """Draw the mean SI (k, d) over a parameter x (k,) and the threshold delta (d,), as a map.

    `marks` are thresholds that are drawn as lines. The faster the colour changes across a line, the
    more the result depends on the threshold.
    """
    figure, (axes,) = style.new_panels(1, style.COLUMN + 1.4, 3.0)
    mesh = style.draw_shares(axes, x, delta, strength)
    for i, mark in enumerate(sorted(marks, reverse=True)):
        axes.axhline(mark, color=style.RED, linewidth=0.9, linestyle="--")
        axes.annotate(
            f"{mark:g}",
            (1.0, mark),
            xycoords=("axes fraction", "data"),
            xytext=(3, 2 if i == 0 else -2),
            textcoords="offset points",
            va="bottom" if i == 0 else "top",
            color=style.RED,
            fontsize=6.5,
        )
    axes.set_yscale("log")
    axes.set_xlabel(label)
    axes.set_ylabel(r"threshold $\delta$ / range of $u$")
    figure.colorbar(mesh, ax=axes, label="mean SI")
    return figure
