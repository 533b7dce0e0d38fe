"""One recording among the runs of an atlas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.projections import PLANES, draw_projection


@style.styled
def judged(
    triplets: ArrayLike, labels: ArrayLike, names: Sequence[str], found: ArrayLike, called: str
) -> Figure:
    """Draw the planes of the variations with the atlas's runs (n, 3) and the recording's (3,)."""
    figure, panels = style.new_panels(3, style.PAGE + 0.6, 2.7)
    look: dict[str, Any] = {"marker": "*", "color": "#ffcc00", "markeredgecolor": style.BLACK}
    mine = np.asarray(found, dtype=np.float64)
    for axes, plane in zip(panels, PLANES, strict=True):
        draw_projection(axes, triplets, labels, names, plane, alpha=0.45)
        x, y = plane
        axes.plot(mine[x], mine[y], linestyle="none", markersize=13.0, zorder=4.0, **look)
    label = f"the recording: {style.drawn(called)}"
    star = Line2D([], [], linestyle="none", markersize=11.0, label=label, **look)
    style.add_class_legend(figure, names, [star])
    style.letter(panels)
    return figure
