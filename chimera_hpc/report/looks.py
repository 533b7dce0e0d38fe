"""How classes look on the page: a colour, a shape and a hatching each, in Bokeh's words."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass

from matplotlib.colors import to_hex

from chimera_hpc.plot.style import colour_of, family_and_number, lighten, marker_of, spoken
from chimera_hpc.reduction.quality import POOR

_SHAPES = {
    "o": ("circle", "circle_dot", "circle_x", "circle_cross"),
    "^": ("triangle", "triangle_dot", "triangle_pin"),
    "s": ("square", "square_dot", "square_x", "square_cross"),
    "v": ("inverted_triangle",),
    "D": ("diamond", "diamond_dot", "diamond_cross"),
    "p": ("star", "star_dot"),
    "h": ("hex", "hex_dot"),
    "X": ("x",),
    "P": ("cross",),
}
_SIGNS = {"circle": "●", "triangle": "▲", "square": "■", "x": "✕", "cross": "✚"}
_SIGNS |= {"inverted": "▼", "diamond": "◆", "star": "★", "hex": "⬢"}
_STROKES = ("x", "cross")
"""Shapes without an inside: their line carries the colour."""
_HATCHES = {"o": "dot", "^": "right_diagonal_line", "s": "cross", "X": "blank", "P": "blank"}
_DARK_GREY = "#6b6b6b"
"""For what does not oscillate: readable on white, which the figures' grey is not as a thin line."""


@dataclass(frozen=True)
class Look:
    """One class, as the page's script takes it."""

    name: str
    colour: str
    pale: str
    marker: str
    line: str
    hatch: str
    sign: str
    """A letter-like sign for text."""


def look_of(name: str) -> Look:
    """Return the look of a class; sub-classes of one class differ in shade and in their inside."""
    number = family_and_number(name)[1]
    symbol = marker_of(name)
    shapes = _SHAPES[symbol]
    shape = shapes[max(number - 1, 0) % len(shapes)]
    colour = _DARK_GREY if shape in _STROKES else to_hex(colour_of(name))
    return Look(
        name=spoken(name),
        colour=colour,
        pale=to_hex(lighten(colour, 0.62)),
        marker=shape,
        line=colour if shape in _STROKES else "#ffffff",
        hatch=_HATCHES.get(symbol, "left_diagonal_line"),
        sign=_SIGNS[shape.partition("_")[0]],
    )


def looks_of(names: tuple[str, ...], poor: Collection[str] = ()) -> list[dict[str, str]]:
    """Return the looks of classes as plain values; poorly fitted ones have a mark at the name."""
    looks = [asdict(look_of(name)) for name in names]
    for name, look in zip(names, looks, strict=True):
        look["name"] += POOR if name in poor else ""
    return looks
