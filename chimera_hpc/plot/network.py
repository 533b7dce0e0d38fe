"""Drawings of oriented rings (paper fig. 1, fig. 17)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.network.layout import circle
from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput

LARGEST_NUMBERED = 24
"""Nodes of the largest network whose nodes are numbered."""


def networks_figure(data: FigureInput) -> Figure | None:
    """Draw the oriented rings, reoriented links in red (paper fig. 1, fig. 17)."""
    entry = data.curves.get("networks")
    if entry is None:
        return None
    panels = [(panel["title"], panel["links"]) for panel in entry["panels"]]
    return networks(panels, entry["panels"][0]["reference"], entry["n_nodes"])


@style.styled
def networks(panels: Sequence[tuple[str, ArrayLike]], reference: ArrayLike, n_nodes: int) -> Figure:
    """Draw rings side by side from (title, links); links that differ from the reference are red.

    links and reference are (N1, 2) arrays of tail and head, 0-based, link by link in one order.
    """
    figure, axes = style.new_panels(len(panels), 2.3 * len(panels), 2.5)
    for frame, (title, links) in zip(axes, panels, strict=True):
        draw_network(frame, links, reference, n_nodes)
        frame.set_title(title)
    style.letter(axes)
    return figure


def draw_network(axes: Axes, links: ArrayLike, reference: ArrayLike, n_nodes: int) -> None:
    """Draw node 0 at the top, the others clockwise, each link as a chord with an arrow."""
    ends, usual = np.asarray(links, dtype=np.int64), np.asarray(reference, dtype=np.int64)
    places = circle(n_nodes)
    turned = np.any(ends != usual, axis=1)
    size = min(0.14, 4.0 / len(ends))
    for chosen, colour, name, order in (
        (~turned, style.BLACK, "as in the ring", 1.0),
        (turned, style.RED, "reoriented", 2.0),
    ):
        chords = places[ends[chosen]]
        width = 0.9 if n_nodes <= LARGEST_NUMBERED else 0.3 * order
        axes.add_collection(
            LineCollection(list(chords), colors=colour, linewidths=width, label=name, zorder=order)
        )
        heads = PolyCollection(list(arrow_heads(chords, size)), facecolors=colour, zorder=order)
        heads.set_linewidth(0.0)
        axes.add_collection(heads)
    numbered = n_nodes <= LARGEST_NUMBERED
    axes.scatter(
        places[:, 0], places[:, 1], s=150.0 if numbered else 14.0, color="#007a6e", zorder=3.0
    )
    for i in range(n_nodes if numbered else 0):
        look: dict[str, Any] = {"ha": "center", "va": "center", "fontweight": "bold"}
        axes.text(places[i, 0], places[i, 1] - 0.01, str(i), color="white", zorder=4.0, **look)
    axes.set_xlim(-1.18, 1.18)
    axes.set_ylim(-1.18, 1.18)
    axes.set_aspect("equal")
    axes.set_axis_off()


def arrow_heads(chords: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Return triangles (k, 3, 2) at the middle of chords (k, 2, 2), tip towards the head."""
    along = chords[:, 1] - chords[:, 0]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    middle = chords.mean(axis=1)
    tip = middle + 0.5 * size * along
    left = middle - 0.5 * size * along + 0.38 * size * across
    right = middle - 0.5 * size * along - 0.38 * size * across
    return np.stack([tip, left, right], axis=1)
