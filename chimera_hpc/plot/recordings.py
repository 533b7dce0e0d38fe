"""Many recordings on one sheet: the planes of their variations, and a space-time plot of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.projections import PLANES, draw_projection
from chimera_hpc.plot.raster import close_up
from chimera_hpc.plot.spacetime import draw_raster

MOST = 60
"""Recordings with a picture, the first ones."""
_COLUMNS = 6
Series = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Times (T,) and u (N, T)."""


@style.styled
def recordings_sheet(
    series: Sequence[Series], titles: Sequence[str], names: Sequence[str], triplets: ArrayLike
) -> Figure:
    """Draw the planes of variations of all recordings, and the last periods of each.

    series (n,) with their titles (n,); names (n,) of their classes; triplets (n, 3), NaN where a
    recording has none. Colours of u are scaled in each picture for itself.
    """
    shown = min(len(series), MOST)
    rows = -(-shown // _COLUMNS)
    figure = style.new_figure(style.PAGE + 1.5, 2.9 + 1.35 * rows)
    parts: Any = figure.subfigures(2, 1, height_ratios=(2.9, 1.35 * rows))
    top, bottom = parts
    kinds = style.in_order(names)
    labels = [kinds.index(name) for name in names]
    for axes, plane in zip(top.subplots(1, 3), PLANES, strict=True):
        draw_projection(axes, triplets, labels, kinds, plane)
    frames = bottom.subplots(rows, _COLUMNS, squeeze=False)
    for frame in frames.flat:
        frame.set_axis_off()
    for frame, (t, u), title, name in zip(frames.flat, series, titles, names, strict=False):
        raster = close_up(t, u)
        draw_raster(frame, raster, float(np.nanmax(np.abs(raster.values), initial=0.0)) or 1.0)
        frame.set_title(title, fontsize="x-small", color=style.colour_of(name))
        frame.tick_params(labelsize=5.0)
    style.add_class_legend(figure, kinds)
    return figure
