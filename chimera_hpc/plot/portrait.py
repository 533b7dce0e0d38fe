"""Phase portraits: orbits in the plane (u, w), and where all nodes are at one moment."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style

_LAST_PERIODS = 12.0
"""Periods of the chosen node that are drawn: the orbit of a long run would fill the plane."""
_LAST_TURNS = 1.5
"""Periods of every node that are drawn behind it."""
_MOST_ORBITS = 300
_MANY = 2000
"""Largest number of nodes with all orbits drawn, and with dots as vectors in a PDF."""


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
    signals: str = "nodes",
) -> Figure:
    """Draw the orbit of one node (0-based) over those of all, and all nodes at the last time.

    t: (T,)
    u, w: (T, N)
    node: its last twelve periods are drawn; of all nodes, in grey, the last one and a half.
    nullcline: whether the model has the cubic nullcline w = u - u^3 / 3.
    period: length of a period; None: whole orbits are drawn.
    signals: where u lives, "nodes", "links" or "triangles".
    """
    figure, (axes,) = style.new_panels(1, style.COLUMN + 1.6, 3.2)
    time, across, along = (np.asarray(x) for x in (t, u, w))
    orbit, last = (_last(time, count, period) for count in (_LAST_PERIODS, _LAST_TURNS))
    some = slice(None, None, -(-across.shape[1] // _MOST_ORBITS))
    grey: dict[str, Any] = {"color": style.GREY, "linewidth": 0.3}
    axes.plot(across[last, some], along[last, some], rasterized=True, **grey)
    look: dict[str, Any] = {"color": style.BLUE, "linewidth": 0.5}
    axes.plot(across[orbit, node], along[orbit, node], rasterized=True, **look)
    if nullcline:
        draw_nullcline(axes, 1.05 * float(np.nanmax(np.abs(across[last]))))
    dots = axes.scatter(
        across[-1],
        along[-1],
        s=14.0,
        c=np.arange(across.shape[1]),
        cmap="twilight",
        edgecolors=style.BLACK,
        linewidths=0.4,
        zorder=3.0,
        rasterized=across.shape[1] > _MANY,
    )
    lengths = ["", ""]
    if period is not None and np.isfinite(period):
        lengths = [f", last {n:g} periods" for n in (_LAST_PERIODS, _LAST_TURNS)]
    axes.plot([], [], color=style.BLUE, label=f"{style.SIGNALS[signals]} {node}{lengths[0]}")
    axes.plot([], [], color=style.GREY, label=f"all {signals}{lengths[1]}")
    axes.set_xlabel("$u_i$")
    axes.set_ylabel("$w_i$")
    axes.set_title(title)
    figure.colorbar(
        dots, ax=axes, label=f"{style.signal_label(signals)} at $t$ = {time[-1]:g}", pad=0.02
    )
    figure.legend(loc="outside lower center", ncols=2, handlelength=1.5)
    return figure


def _last(time: NDArray[np.float64], periods: float, period: float | None) -> slice:
    """Return the last periods as a slice, all times where the period is not known."""
    if period is None or not np.isfinite(period):
        return slice(None)
    return slice(int(np.searchsorted(time, time[-1] - periods * period)), None)


def draw_nullcline(axes: Axes, reach: float) -> None:
    """Draw w = u - u^3 / 3, where du/dt = 0, for |u| up to `reach`."""
    line = np.linspace(-reach, reach, 400)
    axes.plot(line, line - line**3 / 3.0, "--", color="#888888", label=r"$\dot u = 0$")
