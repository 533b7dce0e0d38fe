"""Colours, markers, sizes and file writing shared by all figures.

Classes differ in shape and in colour, and the colours differ in lightness and in hue. The figures
can therefore be read by colour-blind people and in greyscale prints.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.colors import Normalize, to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

COLUMN = 3.4
PAGE = 7.0
"""Widths of one column and of two, in inches."""

RED, BLUE, BLACK, TEAL, GREEN = "#cc3311", "#0057b8", "#111111", "#009988", "#44aa22"
GREY = "#bdbdbd"

_FAMILIES = {
    "ordered": (RED, "o"),
    "chimera": (BLUE, "^"),
    "disordered": (BLACK, "s"),
    "steady": (GREY, "X"),
    "no_window": (GREY, "P"),
    "multi-chimera": (TEAL, "v"),
}
_OTHERS = ((TEAL, "v"), ("#aa3377", "D"), ("#997700", "p"), ("#66ccee", "h"))
# Classes without names of their own, A to D; E looks as A.
_LETTERS = "ABCD"
_PALER = (0.0, 0.35, 0.6, 0.75)
_SHADES = {
    "ordered": ("#ee8866", "#8f1402", "#f4b8a4", "#5c0a00"),
    "chimera": ("#6da8e8", "#003a7d", "#a9cdf2", "#6a4fd0"),
    "disordered": (BLACK, "#8a8a8a", "#555555", "#b0b0b0"),
}

# Any: matplotlib types its setting names as one long list of literals.
SETTINGS: Any = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.grid": False,
    "axes.axisbelow": True,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "mathtext.fontset": "dejavusans",
    "figure.constrained_layout.w_pad": 0.05,
    "figure.constrained_layout.h_pad": 0.05,
}

_MOST_NAMES = 12
_TRIES = 4
"""Largest number of times that ticks are thinned out."""

Arguments = ParamSpec("Arguments")
Made = TypeVar("Made")


def styled(make: Callable[Arguments, Made]) -> Callable[Arguments, Made]:
    """Run a figure function under the project's settings; matplotlib's own stay as they are."""

    @wraps(make)
    def make_styled(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Made:
        with mpl.rc_context(SETTINGS):
            return make(*args, **kwargs)

    return make_styled


class ShownFigure(Figure):
    """A figure that a notebook shows, without pyplot."""

    def _repr_png_(self) -> bytes:
        drawn = BytesIO()
        with mpl.rc_context(SETTINGS):
            self.savefig(drawn, dpi=100)
        return drawn.getvalue()


def new_figure(width: float = PAGE, height: float = 2.4) -> Figure:
    """Return an empty figure of this size in inches, with the layout that clips nothing."""
    return ShownFigure(figsize=(width, height), layout="constrained")


def new_panels(
    count: int, width: float = PAGE, height: float = 2.4, **sharing: Any
) -> tuple[Figure, list[Axes]]:
    """Return a figure of this size in inches and its panels, side by side."""
    figure = new_figure(width, height)
    return figure, list(figure.subplots(1, count, squeeze=False, **sharing)[0])


def scatter_class(
    axes: Axes, x: ArrayLike, y: ArrayLike, name: str, size: float, **look: Any
) -> None:
    """Put the marker of a class, in its colour, at each (x, y); `look` overrides both."""
    plain = {"marker": marker_of(name), "color": colour_of(name), "label": drawn(name)}
    axes.scatter(x, y, s=size, linewidths=0.0, **{**plain, **look})


def draw_shares(axes: Axes, x: ArrayLike, y: ArrayLike, shares: ArrayLike) -> QuadMesh:
    """Draw shares (n_x, n_y) from 0 to 1 over x (n_x,) and y (n_y,); white if missing.

    x and y are centres of cells and need not be equally spaced.
    """
    return axes.pcolormesh(
        np.asarray(x, float),
        np.asarray(y, float),
        np.ma.masked_invalid(np.asarray(shares, float).T),
        shading="nearest",
        vmin=0.0,
        vmax=1.0,
        cmap="viridis",
        rasterized=True,
    )


def mappable(scale: Normalize, colours: str) -> ScalarMappable:
    """Return what a colour bar of this scale and colour map shows."""
    return ScalarMappable(scale, colours)


SIGNALS = {"nodes": "node", "links": "link", "triangles": "triangle"}
"""What one of the simplices that carry u is called."""


def signal_label(signals: str, ordered: bool = False) -> str:
    """Return the label of an axis along nodes, links or triangles.

    ordered: whether they are in the order of the network instead of that of their numbers.
    """
    return f"{signals}, by community" if ordered else f"{SIGNALS[signals]} $i$"


def set_ticks(axis: Axis, values: ArrayLike, **rules: Any) -> None:
    """Put ticks by the rules of MaxNLocator, at integers only if all values are integers."""
    data = np.asarray(values, float)
    whole = bool(np.all(data == np.rint(data)))
    axis.set_major_locator(MaxNLocator(**{"integer": whole, **rules}))


def name_nodes(axis: Axis, names: Sequence[str], **look: Any) -> None:
    """Put the names of nodes, a dozen at most, at their numbers along an axis."""
    ticks = np.unique(np.linspace(0, len(names) - 1, min(_MOST_NAMES, len(names))).astype(int))
    axis.set_ticks(ticks.tolist(), [plain(names[i]) for i in ticks], **look)


def plain(text: str) -> str:
    """Escape the dollar signs of a text, so that they do not begin a formula, and what no font has.

    Names of files may hold bytes that are no text.
    """
    return text.encode("utf-8", "replace").decode("utf-8").replace("$", r"\$")


def save(figure: Figure, path_without_suffix: str | Path) -> tuple[Path, Path]:
    """Write the figure as PNG (200 dots per inch) and PDF; return both paths.

    Equal figures give equal bytes: no date is written. Ticks are left out where labels overlap.
    """
    stem = Path(path_without_suffix)
    png, pdf = stem.with_name(stem.name + ".png"), stem.with_name(stem.name + ".pdf")
    with mpl.rc_context(SETTINGS):
        figure.draw_without_rendering()
        for _ in range(_TRIES):
            if not thin_ticks(figure):
                break
            figure.draw_without_rendering()
        # With a layout engine, matplotlib draws twice for each file.
        figure.set_layout_engine(None)
        figure.savefig(png, dpi=200)
        figure.savefig(pdf, dpi=200, metadata={"CreationDate": None})
    return png, pdf


def thin_ticks(figure: Figure) -> bool:
    """Remove every other tick of axes whose labels overlap; return whether there were any.

    The figure must have been drawn before.
    """
    flat = [axes for axes in figure.axes if axes.name != "3d"]
    crowded = [axis for axes in flat for axis in (axes.xaxis, axes.yaxis) if _overlaps(axis)]
    for axis in crowded:
        seen = _seen_labels(axis)[::2]
        axis.set_ticks([x for x, _ in seen], [label.get_text() for _, label in seen])
    return bool(crowded)


def _seen_labels(axis: Axis) -> list[tuple[float, Text]]:
    """Return place and label of each tick that is seen."""
    low, high = sorted(axis.get_view_interval())
    labels = zip(axis.get_majorticklocs().tolist(), axis.get_majorticklabels(), strict=False)
    return [(x, label) for x, label in labels if low <= x <= high and label.get_text()]


def _overlaps(axis: Axis) -> bool:
    boxes = [label.get_window_extent() for _, label in _seen_labels(axis)]
    return any(one.overlaps(other) for one, other in pairwise(boxes))


def family_and_number(name: str) -> tuple[str, int]:
    """Split a class name into its base class and its number: ``ordered-2`` -> (ordered, 2)."""
    found = re.fullmatch(r"(.+)-(\d+)", name)
    return (found.group(1), int(found.group(2))) if found else (name, 0)


def colour_of(name: str | None) -> str:
    """Return the colour of a class; sub-classes are lighter and darker variants of their class."""
    if name is None:
        return "#ffffff"
    family, number = family_and_number(name)
    if number and family in _SHADES:
        shades = _SHADES[family]
        return shades[(number - 1) % len(shades)]
    if number and family in _LETTERS:
        return to_hex(lighten(_look(family)[0], _PALER[(number - 1) % len(_PALER)]))
    return _look(name)[0]


def marker_of(name: str | None) -> str:
    """Return the marker of a class: the same for all sub-classes of a class."""
    return "." if name is None else _look(name)[1]


def _look(name: str) -> tuple[str, str]:
    family, number = family_and_number(name)
    if family in _FAMILIES:
        return _FAMILIES[family]
    if family in _LETTERS:
        return _OTHERS[_LETTERS.index(family)]
    return _OTHERS[(number or sum(map(ord, name))) % len(_OTHERS)]


def lighten(colour: str, share: float = 0.6) -> tuple[float, float, float]:
    """Mix a colour with white."""
    red, green, blue = (1.0 - share) * np.array(to_rgb(colour)) + share
    return (float(red), float(green), float(blue))


def in_order(names: Iterable[str]) -> list[str]:
    """Sort class names: ordered, chimera, disordered, others, steady, no window."""
    known = [*list(_FAMILIES)[:3], "", "steady", "no_window"]

    def place(name: str) -> tuple[int, str, int]:
        family, number = family_and_number(name)
        return (known.index(family if family in known else ""), family, number)

    return sorted(set(names), key=place)


def spoken(name: str) -> str:
    """Return a class name as it is written in legends."""
    return name.replace("_", " ")


def drawn(name: str) -> str:
    """Return a class name as it is written in figures."""
    return plain(spoken(name))


def class_handles(names: Iterable[str], size: float = 5.0) -> list[Line2D]:
    """Return one legend entry per class, in the fixed order."""
    return [
        Line2D(
            [],
            [],
            linestyle="none",
            marker=marker_of(name),
            color=colour_of(name),
            markersize=size,
            label=drawn(name),
        )
        for name in in_order(names)
    ]


def add_class_legend(figure: Figure, names: Iterable[str], extra: Iterable[Line2D] = ()) -> None:
    """Put a legend of classes above all panels, in as many rows as the width asks for."""
    add_legend(figure, [*class_handles(names), *extra])


def add_legend(figure: Figure, handles: Sequence[Line2D]) -> None:
    """Put a legend above all panels, in as many rows as the width asks for."""
    columns = max(1, min(len(handles), int(figure.get_figwidth() / 1.15)))
    figure.legend(handles=handles, loc="outside upper center", ncols=columns)


def letter(axes: Sequence[Axes]) -> None:
    """Write (a), (b), ... at the upper left outside of panels, before their titles."""
    if len(axes) == 1:
        return
    for i, panel in enumerate(axes):
        title = panel.get_title()
        label = f"({chr(ord('a') + i)})"
        panel.set_title("")
        panel.set_title(f"{label}  {title}" if title else label, loc="left")
