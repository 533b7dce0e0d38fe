"""How often cells keep their class, drawn along an axis and over a plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from chimera_hpc.plot import style
from chimera_hpc.plot.modes import modal_classes

Render = Callable[[Figure], Figure]
LINE = [("$P = Q$", [1, 2, 3, 4])]
PLANE = [("$P$", [1, 2, 3, 4]), ("$Q$", [5, 6, 7, 8])]
CLASSES = ["ordered", "chimera", "steady", None]
KEPT = [0.95, 0.7, np.nan, np.nan]


def test_a_panel_below_the_classes_has_a_bar_for_each_known_share(rendered: Render) -> None:
    figure = rendered(modal_classes(LINE, CLASSES, kept=KEPT))
    upper, lower = figure.axes
    heights = [bar.get_height() for bar in lower.patches]
    np.testing.assert_array_equal(heights, KEPT)
    centres = [bar.get_x() + 0.5 * bar.get_width() for bar in lower.patches]
    np.testing.assert_allclose(centres, [1, 2, 3, 4])
    assert to_rgb(lower.patches[1].get_facecolor()) == to_rgb(style.colour_of("chimera"))
    assert lower.lines[0].get_ydata()[0] == 0.9
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("", "$P = Q$")
    assert lower.get_position().y1 < upper.get_position().y0
    assert upper.get_xlim() == lower.get_xlim()


def test_markers_of_cells_below_the_level_are_open(rendered: Render) -> None:
    figure = rendered(modal_classes(PLANE, CLASSES, kept=KEPT))
    white = [
        marks
        for marks in figure.axes[0].collections
        if len(marks.get_offsets()) and to_rgb(marks.get_facecolor()[0]) == (1.0, 1.0, 1.0)
    ]
    assert [marks.get_offsets().tolist() for marks in white] == [[[2, 6]]]
    assert [text.get_text() for text in figure.legends[0].texts][-1] == "stays in < 90%"


def test_without_an_audit_there_is_neither() -> None:
    assert len(modal_classes(LINE, CLASSES).axes) == 1
    assert len(modal_classes(PLANE, CLASSES).axes[0].collections) == 4  # cells, and three classes
