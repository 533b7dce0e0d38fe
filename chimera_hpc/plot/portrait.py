"""Phase portraits: orbits in the plane (u, w), and where all nodes are at one moment."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style

_LAST_TURNS = 1.5
"""Turns of every node that are drawn behind the chosen one's."""


@style.styled
def ring_portrait(
    t: ArrayLike,
    u: ArrayLike,
    w: ArrayLike,
    node: int,
    *,
    title: str = "",
    nullcline: bool = False,
    period: float | None = None,
) -> Figure:
    """Draw the orbit of one node (0-based) over those of all, and all nodes at the last time.

    t: (T,)
    u, w: (T, N)
    node: its whole orbit is drawn; of the others, in grey, the last turns.
    nullcline: whether the model has the cubic nullcline w = u - u^3 / 3.
    period: length of a turn; without it the others are drawn whole.
    """
    figure, (axes,) = style.new_panels(1, style.COLUMN + 1.6, 3.2)
    time, across, along = (np.asarray(x, dtype=np.float64) for x in (t, u, w))
    last = slice(None)
    if period is not None and np.isfinite(period):
        last = slice(int(np.searchsorted(time, time[-1] - _LAST_TURNS * period)), None)
    axes.plot(across[last], along[last], color=style.GREY, linewidth=0.3, rasterized=True)
    axes.plot(across[:, node], along[:, node], color=style.BLUE, linewidth=0.5, rasterized=True)
    if nullcline:
        draw_nullcline(axes, 1.05 * float(np.nanmax(np.abs(across))))
    dots = axes.scatter(
        across[-1],
        along[-1],
        s=14.0,
        c=np.arange(1, across.shape[1] + 1),
        cmap="twilight",
        edgecolors=style.BLACK,
        linewidths=0.4,
        zorder=3.0,
    )
    axes.plot([], [], color=style.BLUE, label=f"node {node + 1}")
    axes.plot([], [], color=style.GREY, label="all nodes, last turns")
    axes.set_xlabel("$u_i$")
    axes.set_ylabel("$w_i$")
    axes.set_title(title)
    figure.colorbar(dots, ax=axes, label=f"node $i$ at $t$ = {time[-1]:g}", pad=0.02)
    figure.legend(loc="outside lower center", ncols=3, handlelength=1.5)
    return figure


def draw_nullcline(axes: Axes, reach: float) -> None:
    """Draw w = u - u^3 / 3, where du/dt = 0, for |u| up to `reach`."""
    line = np.linspace(-reach, reach, 400)
    axes.plot(line, line - line**3 / 3.0, "--", color="#888888", label=r"$\dot u = 0$")
