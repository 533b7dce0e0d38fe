"""Runs in the space of variations: three planes and a view in three dimensions.

Paper fig. 5 (b) and fig. 13.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput

LABELS = (r"$V_\theta$", r"$V_a$", r"$V_\Omega$ (1/time)")
PLANES = ((0, 1), (0, 2), (1, 2))
_MANY = 500
"""Number of points above which a PDF holds an image of them instead of a path for each."""

_CROWDED = 20_000
"""Number of runs above which markers are small and translucent."""


def projections_figure(data: FigureInput, n_clusters: int) -> Figure | None:
    """Draw the three planes of variations and a view in 3-D (paper fig. 13)."""
    cut = data.classification.cuts[n_clusters]
    return projections(data.triplets, cut.labels, cut.names) if cut.names else None


@style.styled
def projections(
    triplets: ArrayLike, labels: ArrayLike, names: Sequence[str], *, angle: float = -60.0
) -> Figure:
    """Draw three planes and a 3-D view of triplets (n, 3); rows with label -1 are left out."""
    figure = style.new_figure(style.PAGE, 5.6)
    grid = figure.add_gridspec(2, 2)
    flat = [figure.add_subplot(grid[i // 2, i % 2]) for i in range(3)]
    for axes, plane in zip(flat, PLANES, strict=True):
        draw_projection(axes, triplets, labels, names, plane)
    solid = figure.add_subplot(grid[1, 1], projection="3d")
    _draw_solid(solid, triplets, labels, names, angle)
    style.letter([*flat, solid])
    style.add_class_legend(figure, names)
    return figure


def draw_projection(
    axes: Axes,
    triplets: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str],
    plane: tuple[int, int] = (0, 1),
    **look: Any,
) -> None:
    """Scatter each class over one plane of (V_theta, V_a, V_Omega), not scaled."""
    x, y = plane
    points, label = np.asarray(triplets, dtype=np.float64), np.asarray(labels)
    size, alpha = _mark(label)
    for i, name in enumerate(names):
        chosen = points[label == i]
        kind = {"alpha": alpha, "rasterized": len(chosen) > _MANY, **look}
        style.scatter_class(axes, chosen[:, x], chosen[:, y], name, size, **kind)
    axes.set_xlabel(LABELS[x])
    axes.set_ylabel(LABELS[y])


def _mark(labels: NDArray[Any]) -> tuple[float, float]:
    """Return area and opacity of the markers: small and translucent if there are many runs.

    Where they overlap, the shade then shows how many there are.
    """
    n_runs = int(np.count_nonzero(labels >= 0))
    if n_runs <= _CROWDED:
        return 11.0, 0.75
    return 2.0, max(0.08, 0.5 * _CROWDED / n_runs)


def _draw_solid(
    axes: Any, triplets: ArrayLike, labels: ArrayLike, names: Sequence[str], angle: float
) -> None:
    points, label = np.asarray(triplets, dtype=np.float64), np.asarray(labels)
    size, alpha = _mark(label)
    # Markers that are far away fade, too.
    look = {"s": min(size, 9.0), "alpha": min(1.0, 3.0 * alpha)}
    for i, name in enumerate(names):
        x, y, z = points[label == i].T
        axes.scatter(
            x,
            y,
            z,
            marker=style.marker_of(name),
            color=style.colour_of(name),
            linewidths=0.0,
            rasterized=len(x) > _MANY,
            **look,
        )
    axes.set_xlabel(LABELS[0], labelpad=-4.0)
    axes.set_ylabel(LABELS[1], labelpad=-4.0)
    axes.set_zlabel(LABELS[2], labelpad=-3.0)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    axes.tick_params(pad=-2.0, labelsize=6.5)
    axes.view_init(elev=22.0, azim=angle)
    axes.set_box_aspect((1.2, 1.2, 0.9), zoom=1.05)
