"""Strength of incoherence against a parameter (paper fig:theirmeth, fig:Sgoodwrong)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.spacetime import Panel, draw_space_time


@dataclass(frozen=True)
class Strengths:
    """SI (k,) for each value of the parameter (k,), all with one threshold."""

    title: str
    x: ArrayLike
    strength: ArrayLike


_KINDS = (("SI = 0", style.RED), ("0 < SI < 1", style.BLUE), ("SI = 1", style.BLACK))


@style.styled
def incoherence(
    panels: Sequence[Strengths], *, label: str = "$P$", dynamics: Panel | None = None
) -> Figure:
    """Draw SI as squares: red at 0, blue between, black at 1; and, if given, (t, u) of one run."""
    count = len(panels) + (dynamics is not None)
    figure = style.new_figure(max(style.COLUMN + 0.6, 2.5 * count), 2.6)
    axes = list(figure.subplots(1, count, squeeze=False)[0])
    for frame, panel in zip(axes, panels, strict=False):
        _draw_strength(frame, panel, label)
    axes[0].set_ylabel("strength of incoherence SI")
    if dynamics is not None:
        largest = float(np.nanmax(np.abs(np.asarray(dynamics[1]))))
        image = draw_space_time(axes[-1], *dynamics, largest)
        axes[-1].set_xlabel("time $t$")
        axes[-1].set_ylabel("node $i$")
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
        axes.scatter(
            x[chosen],
            strength[chosen],
            s=16.0,
            marker="s",
            color=colour,
            linewidths=0.0,
            label=name,
        )
    axes.set_ylim(-0.06, 1.06)
    whole = bool(np.all(x == np.rint(x)))
    axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 3, 4, 5, 10], integer=whole))
    axes.set_xlabel(label)
    axes.set_title(panel.title)


@style.styled
def incoherence_sensitivity(
    x: ArrayLike, delta: ArrayLike, strength: ArrayLike, marks: Sequence[float], *, label: str
) -> Figure:
    """Draw the mean SI (k, d) over a parameter x (k,) and the threshold delta (d,), as a map.

    `marks` are thresholds that stand as lines: how fast the colour changes across a line is how
    much the verdict hangs on the threshold.
    """
    figure = style.new_figure(style.COLUMN + 1.4, 3.0)
    axes = figure.subplots()
    mesh = axes.pcolormesh(
        np.asarray(x, float),
        np.asarray(delta, float),
        np.ma.masked_invalid(np.asarray(strength, float).T),
        shading="nearest",
        vmin=0.0,
        vmax=1.0,
        cmap="viridis",
        rasterized=True,
    )
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
