from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure


@pytest.fixture
def colour_at() -> Callable[[Axes, float, float], list[tuple[float, float, float]]]:
    """Colours of all scatter markers at one place."""

    def find(axes: Axes, x: float, y: float) -> list[tuple[float, float, float]]:
        found = []
        for collection in axes.collections:
            places = np.asarray(collection.get_offsets(), dtype=float)
            colours = collection.get_facecolors()
            for i, place in enumerate(places):
                if np.allclose(place, (x, y)):
                    colour = colours[min(i, len(colours) - 1)]
                    found.append(tuple(np.round(to_rgb(colour), 6)))
        return found

    return find


@pytest.fixture
def rendered() -> Callable[[Figure], Figure]:
    """Lay a figure out and fail if anything in it leaves the page."""

    def render(figure: Figure) -> Figure:
        figure.draw_without_rendering()
        used = figure.get_tightbbox()
        width, height = figure.get_size_inches()
        assert min(used.x0, used.y0) >= -0.01, "clipped at the left or the bottom"
        assert used.x1 <= width + 0.01, "clipped at the right"
        assert used.y1 <= height + 0.01, "clipped at the top"
        return figure

    return render
