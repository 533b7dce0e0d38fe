"""The stability domain f(P, R) as a map (paper fig:stability)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style


@style.styled
def basin(
    half_degree: ArrayLike, radius: ArrayLike, fraction: ArrayLike, safe_radius: ArrayLike = ()
) -> Figure:
    """Draw f (n_P, n_R) over P (n_P,) and R (n_R,), with the largest radius of f = 1 as a line.

    Cells without a run are white. P and R are taken as centres of cells and need not be equally
    spaced.
    """
    figure = style.new_figure(style.COLUMN + 1.2, 3.0)
    axes = figure.subplots()
    degrees, radii = np.asarray(half_degree, float), np.asarray(radius, float)
    mesh = axes.pcolormesh(
        degrees,
        radii,
        np.ma.masked_invalid(np.asarray(fraction, float).T),
        shading="nearest",
        vmin=0.0,
        vmax=1.0,
        cmap="viridis",
        rasterized=True,
    )
    safe = np.asarray(safe_radius, float)
    if len(safe):
        axes.plot(degrees, safe, "o-", color=style.RED, markersize=2.5, label="$f = 1$ up to here")
        axes.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none")
    axes.set_xlabel("$P$")
    axes.set_ylabel("radius $R$")
    figure.colorbar(mesh, ax=axes, label="$f = N'/N$")
    return figure
