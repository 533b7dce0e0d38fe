"""Phase portraits: the orbit of single nodes in the plane (u, w)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style

_COLOURS = (style.BLUE, style.RED, style.TEAL, "#997700", "#aa3377", "#555555")


@style.styled
def phase_portrait(
    u: ArrayLike,
    w: ArrayLike,
    nodes: Sequence[int],
    *,
    title: str = "",
    labels: tuple[str, str] = ("$u_i$", "$w_i$"),
) -> Figure:
    """Draw the orbits of some nodes (0-based) of u and w, both (T, N), over the cubic nullcline.

    w is the sum that a node sees of its links, w = B1 v; du/dt = 0 on w = u - u^3 / 3.
    """
    figure = style.new_figure(style.COLUMN + 1.2, 3.1)
    axes = figure.subplots()
    across, along = np.asarray(u, float), np.asarray(w, float)
    reach = 1.08 * float(np.nanmax(np.abs(across[:, list(nodes)])))
    line = np.linspace(-reach, reach, 400)
    axes.plot(line, line - line**3 / 3.0, "--", color="#888888", label=r"$\dot u = 0$")
    for i, node in enumerate(nodes):
        axes.plot(
            across[:, node],
            along[:, node],
            color=_COLOURS[i % len(_COLOURS)],
            linewidth=0.6,
            label=f"node {node + 1}",
        )
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.set_title(title)
    figure.legend(loc="outside right upper", handlelength=1.5)
    return figure
