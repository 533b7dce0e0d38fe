"""Fraction of chimeras along a parameter, as after random reorientations (paper fig. 19)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers

_LOOKS: dict[str, dict[str, Any]] = {
    "orientation 1": {"color": style.GREEN, "marker": "*", "markersize": 6.5},
    "orientation 2": {"color": style.TEAL, "marker": "o", "markersize": 4.0},
}
REVERSED = "reversed links $Q_r$"
_SPARE = ("#aa3377", "#997700", "#0057b8", "#777777")


def robustness_figure(data: FigureInput) -> Figure | None:
    """Draw W(Q_r) (paper fig. 19), or W against a parameter of networks, and sweeps next to it."""
    curves = [*data.beside.values(), data.curves]
    bands, label = {}, REVERSED
    for entry in (each["robustness"] for each in curves if "robustness" in each):
        label = entry.get("symbol", REVERSED)
        for each in entry.get("curves", [entry]):
            curve = each["by"][entry["judge"]]
            fraction, low, high = (numbers(curve[name]) for name in ("fraction", "low", "high"))
            bands[each["label"]] = Band(curve["x"], fraction, low, high)
    return robustness(bands, label=label) if bands else None


@dataclass(frozen=True)
class Band:
    """A fraction along x with the ends of its interval; every array is (k,)."""

    x: ArrayLike
    fraction: ArrayLike
    low: ArrayLike
    high: ArrayLike


@style.styled
def robustness(
    curves: Mapping[str, Band], *, label: str = "reoriented links $Q_r$", value: str = "$W$"
) -> Figure:
    """Draw each named curve with its band; teal dots orientation 2, green stars orientation 1."""
    figure, (axes,) = style.new_panels(1, style.COLUMN + 1.4, 2.8)
    spare = iter(_SPARE * (1 + len(curves) // len(_SPARE)))
    for name, curve in curves.items():
        look = _LOOKS.get(name) or {"color": next(spare), "marker": "s", "markersize": 3.5}
        axes.fill_between(
            curve.x, curve.low, curve.high, color=look["color"], alpha=0.18, linewidth=0.0
        )
        axes.plot(curve.x, curve.fraction, linewidth=0.7, markeredgewidth=0.0, label=name, **look)
    positive = np.concatenate([np.asarray(curve.x, float) for curve in curves.values()])
    positive = positive[positive > 0.0]
    if label != REVERSED and len(positive) and positive.max() >= 100.0 * positive.min():
        axes.set_xscale("symlog", linthresh=positive.min())
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel(label)
    axes.set_ylabel(value)
    figure.legend(loc="outside upper center", ncols=min(len(curves), 3))
    return figure
