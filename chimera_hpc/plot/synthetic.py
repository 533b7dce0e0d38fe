"""Reconstruction of a signal whose features are known (paper fig. 11)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.measures.synthetic import profile_error
from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput
from chimera_hpc.plot.spacetime import space_time

Quantities = Mapping[str, ArrayLike]
"""phase, amplitude and frequency, each (N,)."""

_ROWS = (
    ("phase", r"\theta", "(rad)"),
    ("amplitude", "a", ""),
    ("frequency", r"\Omega", "(1/time)"),
)
_LOOKS = ((style.GREEN, "."), ("#aa3377", "x"), (style.BLUE, "+"))
_FLOOR = 1e-17


def reconstruction_figure(data: FigureInput) -> Figure | None:
    """Draw known and found profiles of the synthetic signal, and the errors (paper fig. 11)."""
    entry = data.curves.get("synthetic")
    return None if entry is None else reconstruction(entry["truth"], entry["found"])


def signal_figure(data: FigureInput) -> Figure | None:
    """Draw the synthetic signal over node and time (paper fig. 10)."""
    entry = data.curves.get("synthetic")
    if entry is None:
        return None
    signal = entry["signal"]
    u = np.asarray(signal["u"], dtype=np.float64)
    return space_time([(signal["t"], u.T)], ["synthetic signal"], symbol="x_j(t)")


@style.styled
def reconstruction(truth: Quantities, found: Mapping[str, Quantities]) -> Figure:
    """Draw true values as black squares, reconstructed ones as dots, and their errors below.

    With one method in `found` the errors have their sign (true - found); with several the panels
    show absolute values on a logarithmic scale. Errors of phases are taken modulo a turn.
    """
    figure = style.new_figure(style.PAGE + 0.4, 4.2)
    axes = figure.subplots(2, 3, sharex=True)
    several = len(found) > 1
    for j, (name, symbol, unit) in enumerate(_ROWS):
        top, bottom = axes[0, j], axes[1, j]
        true = np.asarray(truth[name], float)
        node = np.arange(len(true))
        top.plot(
            node, true, "s", color=style.BLACK, markersize=4.5, markerfacecolor="none", label="true"
        )
        for (method, values), (colour, marker) in zip(found.items(), _LOOKS, strict=False):
            error = profile_error(true, np.asarray(values[name], float), name == "phase")
            estimate = true - error
            look = {"color": colour, "marker": marker, "markersize": 3.5, "linestyle": "none"}
            top.plot(node, estimate, label=method, **look)
            bottom.plot(node, np.maximum(np.abs(error), _FLOOR) if several else error, **look)
        mean = rf"\langle {symbol}\rangle"
        top.set_ylabel(rf"${symbol}_0$, ${mean}$ {unit}".rstrip())
        difference = rf"{symbol}_0 - {mean}"
        bottom.set_ylabel((rf"$|{difference}|$" if several else rf"${difference}$") + f" {unit}")
        bottom.set_yscale("log" if several else "linear")
        bottom.set_xlabel("node $j$")
    style.letter(list(axes.flat))
    figure.align_ylabels(axes)
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=len(names))
    return figure
