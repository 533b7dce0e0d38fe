"""Error bars of a phase diagram: how firm the class of each cell is (the audit of the labels)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from chimera_hpc.plot import style

Array = NDArray[np.float64]

_LOOKS = (("s", style.RED), ("o", style.BLUE), ("^", style.BLACK))
_FIRM = 0.95


@dataclass(frozen=True)
class Firmness:
    """What the audit found in k cells; NaN where there is nothing to say."""

    classes: Sequence[str | None]
    """Modal class of each cell."""
    share: Array
    """(k,) share of the modal class among the cell's runs."""
    low: Array
    high: Array
    """(k,) middle 95 % of this share over resampled seeds."""
    stays: Array
    """(k,) share of the resamplings with the same modal class."""
    changes: Mapping[str, Array]
    """For each way of running again (k,) share of the cell's audited runs that changed class."""


@style.styled
def audit_against(x: Array, found: Firmness, *, label: str = "$P = Q$") -> Figure:
    """Draw over a parameter the modal class's share with its error bar, and below the changes."""
    figure = style.new_figure(style.PAGE, 3.9)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0))
    for name in style.in_order(name for name in found.classes if name is not None):
        chosen = np.array([other == name for other in found.classes])
        middle, low, high = (a[chosen] for a in (found.share, found.low, found.high))
        upper.errorbar(
            x[chosen],
            middle,
            yerr=np.maximum([middle - low, high - middle], 0.0),
            fmt=style.marker_of(name),
            color=style.colour_of(name),
            markersize=3.5,
            linewidth=0.8,
            capsize=1.5,
        )
    weak = found.stays < _FIRM
    upper.plot(x[weak], np.full(int(weak.sum()), 1.12), "v", color=style.GREY, markersize=4.0)
    upper.set_ylim(-0.03, 1.18)
    upper.set_ylabel("share of modal class\n(bar: 95 %, bootstrap)")
    _draw_changes(lower, x, found.changes)
    lower.set_xlabel(label)
    lower.xaxis.set_major_locator(MaxNLocator(integer=bool(np.all(x == np.rint(x))), nbins=12))
    style.letter([upper, lower])
    style.add_class_legend(figure, [name for name in found.classes if name is not None], [_weak()])
    return figure


@style.styled
def audit_map(
    x: Array, y: Array, found: Firmness, *, labels: tuple[str, str] = ("$P$", "$Q$")
) -> Figure:
    """Draw over a plane how often each modal class stays, and beside it the changes."""
    panels = 1 + len(found.changes)
    figure = style.new_figure(style.PAGE + 2.0, 2.9)
    axes = list(figure.subplots(1, panels, sharex=True, sharey=True))
    shown = _scatter(axes[0], x, y, found.stays, "cividis")
    axes[0].set_title("bootstrap: class stays")
    for panel, (way, change) in zip(axes[1:], found.changes.items(), strict=True):
        panel.scatter(x, y, s=3.0, color="#dddddd", linewidths=0.0)
        changed = _scatter(panel, x, y, change, "Reds", edge=True)
        panel.set_title(way)
    for panel in axes:
        panel.set_xlabel(labels[0])
        panel.xaxis.set_major_locator(MaxNLocator(5, integer=bool(np.all(x == np.rint(x)))))
    axes[0].set_ylabel(labels[1])
    style.letter(axes)
    figure.colorbar(shown, ax=axes[0], location="bottom", label="probability", aspect=25)
    if found.changes:
        figure.colorbar(
            changed,
            ax=axes[1:],
            location="bottom",
            label="change of class fractions (circles: cells with audited runs)",
            aspect=60,
        )
    return figure


def _scatter(
    axes: Axes, x: Array, y: Array, value: Array, colours: str, edge: bool = False
) -> PathCollection:
    known = np.isfinite(value)
    return axes.scatter(
        x[known],
        y[known],
        c=value[known],
        s=15.0,
        vmin=0.0,
        vmax=1.0,
        cmap=colours,
        linewidths=0.4 if edge else 0.0,
        edgecolors="#888888",
    )


def _draw_changes(axes: Axes, x: Array, changes: Mapping[str, Array]) -> None:
    """Put one row of symbols a way of running again, side by side at each audited value of x."""
    apart = max(0.2 * np.diff(np.unique(x)).min(initial=np.inf), 0.004 * np.ptp(x))
    for i, (way, change) in enumerate(changes.items()):
        known = np.isfinite(change)
        marker, colour = _LOOKS[i % len(_LOOKS)]
        axes.plot(
            x[known] + apart * (i - 0.5 * (len(changes) - 1)),
            change[known],
            marker,
            color=colour,
            fillstyle="none",
            markersize=4.0,
            markeredgewidth=0.9,
            label=way,
        )
    axes.set_ylim(-0.08, 1.08)
    axes.set_ylabel("change of class\nfractions (audited)")
    if changes:
        axes.legend(loc="upper center", ncols=len(changes), bbox_to_anchor=(0.5, 1.22))


def _weak() -> Line2D:
    return Line2D(
        [],
        [],
        linestyle="none",
        marker="v",
        color=style.GREY,
        markersize=4.0,
        label=f"class stays below {_FIRM:g}",
    )
