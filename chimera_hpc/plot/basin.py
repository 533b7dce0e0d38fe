"""The stability domain f(P, R) as a map (paper fig. 2)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers


def basin_figure(data: FigureInput) -> Figure | None:
    """Draw f(P, R) (paper fig. 2)."""
    entry = data.curves.get("basin")
    if entry is None:
        return None
    fraction, safe = numbers(entry["fraction"]), numbers(entry["safe_radius"])
    return basin(entry["P"], entry["radius"], fraction, safe)


@style.styled
def basin(
    half_degree: ArrayLike, radius: ArrayLike, fraction: ArrayLike, safe_radius: ArrayLike = ()
) -> Figure:
    """Draw f (n_P, n_R) over P (n_P,) and R (n_R,), with the largest radius of f = 1 as a line."""
    figure, (axes,) = style.new_panels(1, style.COLUMN + 1.2, 3.0)
    mesh = style.draw_shares(axes, half_degree, radius, fraction)
    safe = np.asarray(safe_radius, float)
    if len(safe):
        label = "$f = 1$ up to here"
        axes.plot(half_degree, safe, "o-", color=style.RED, markersize=2.5, label=label)
        axes.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none")
    axes.set_xlabel("$P$")
    axes.set_ylabel("radius $R$")
    figure.colorbar(mesh, ax=axes, label="$f = N'/N$")
    return figure
