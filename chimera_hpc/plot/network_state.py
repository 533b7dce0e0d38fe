"""A network with a run on it: its nodes, links or triangles coloured by class and features."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.measures.fourier import FEATURES
from chimera_hpc.network.layout import node_places
from chimera_hpc.network.network import Network
from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import DrawnRun, FigureInput
from chimera_hpc.plot.network import LARGEST_NUMBERED, arrow_heads
from chimera_hpc.plot.raster import bins

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_DRAWN = 10_000
"""Most nodes, links or triangles that are drawn; of more, evenly spread ones."""
_MOST_ARROWS = 80
_FEW = 300
"""Nodes of the largest network that has dots for nodes without u."""
_MANY = 1000
"""Number of simplices above which a PDF holds an image of them instead of a path for each."""
_COLUMNS = (
    ("amplitude", "viridis", r"amplitude $\langle a\rangle$"),
    ("phase", "twilight", r"phase $\langle\theta\rangle$ (rad)"),
    ("frequency", "viridis", r"frequency $\langle\Omega\rangle$ (1/time)"),
)
_PALE = "#c4c4c4"


def network_state_figure(data: FigureInput) -> Figure | None:
    """Draw the network of each run to show, coloured by its class, amplitude, phase, frequency."""
    states = [state_of(run) for run in data.shown if run.network is not None]
    return network_states(states) if states else None


@dataclass(frozen=True, eq=False)
class NetworkState:
    """A network and what a run did on it."""

    network: Network
    title: str = ""
    signals: str = "nodes"
    """Where u lives: "nodes", "links" or "triangles"."""
    class_name: str = ""
    features: Array | None = None
    """(8, N_k) in the order of `measures.fourier.FEATURES`; None if nothing oscillates."""


def state_of(run: DrawnRun) -> NetworkState:
    """Return what is drawn of a run that has a network."""
    assert run.network is not None
    return NetworkState(run.network, run.title, run.signals, run.class_name, run.features)


@style.styled
def network_states(states: Sequence[NetworkState], layout: str | ArrayLike = "auto") -> Figure:
    """Draw a row for each run: the network in the colour of its class, and with its features.

    Each feature has one colour scale for all runs. `layout` as in `network.layout.node_places`.
    Small networks have their nodes numbered, and arrows on their links if these are few.
    """
    rows = len(states)
    figure = style.new_figure(style.PAGE, 0.7 + 2.0 * rows)
    heights = [1.0] * rows + [0.05]
    *axes, bars = figure.subplots(rows + 1, 1 + len(_COLUMNS), height_ratios=heights, squeeze=False)
    scales = [_scale(states, name) for name, _, _ in _COLUMNS]
    for row, state in zip(axes, states, strict=True):
        drawing = Drawing(state.network, state.signals, node_places(state.network, layout))
        drawing.draw_structure(row[0], state.class_name)
        row[0].set_title("\n".join(filter(None, [state.title, drawing.partly])))
        for frame, (name, colours, _), scale in zip(row[1:], _COLUMNS, scales, strict=True):
            if (values := _feature(state, name)) is None:
                drawing.draw_nothing(frame)
            else:
                drawing.draw_values(frame, values, scale, colours)
    bars[0].set_axis_off()
    for place, (_, colours, label), scale in zip(bars[1:], _COLUMNS, scales, strict=True):
        shown = style.mappable(scale, colours)
        figure.colorbar(shown, cax=place, orientation="horizontal", label=label)
        style.set_ticks(place.xaxis, [0.5], nbins=4)
    style.letter([row[0] for row in axes])
    return figure


class Drawing:
    """The parts of a picture of one network, placed once for all its panels."""

    def __init__(self, network: Network, signals: str, places: Array) -> None:
        self.network, self.signals, self.places = network, signals, places
        self._nodes = bins(network.n_nodes, MOST_DRAWN)
        self._links = bins(network.n_links, MOST_DRAWN) if network.n_links else self._nodes[:0]
        count = network.n_triangles
        self._triangles = bins(count, MOST_DRAWN) if count else self._nodes[:0]

    @property
    def partly(self) -> str:
        """What is not drawn, in words; empty if all is drawn."""
        parts = (
            ("nodes", self._nodes, self.network.n_nodes),
            ("links", self._links, self.network.n_links),
        )
        drawn = [f"{len(some)} of {n} {what}" for what, some, n in parts if len(some) < n]
        return ", ".join(drawn)

    @property
    def is_small(self) -> bool:
        """Whether nodes are numbered."""
        return self.network.n_nodes <= LARGEST_NUMBERED

    @cached_property
    def chords(self) -> Array:
        """(links drawn, 2, 2) from tail to head."""
        chords: Array = self.places[self.network.links[self._links]]
        return chords

    @cached_property
    def faces(self) -> Array:
        """(triangles drawn, 3, 2)"""
        if self.network.triangles is None:
            return np.empty((0, 3, 2))
        faces: Array = self.places[self.network.triangles[self._triangles]]
        return faces

    def draw_structure(self, axes: Axes, class_name: str) -> None:
        """Draw the network with what carries u in the colour and the shape of a class."""
        colour = style.colour_of(class_name) if class_name else style.TEAL
        kind = {"links": self._add_links, "triangles": self._add_faces}.get(self.signals)
        if kind is None:
            marker = style.marker_of(class_name) if class_name and not self.is_small else "o"
            self._add_links(axes, colors=_PALE)
            self._add_nodes(axes, marker=marker, color=colour)
        else:
            self._add_background(axes)
            kind(axes, colors=colour)
        if self.is_small:
            if len(self.chords) <= _MOST_ARROWS:
                self._add_arrows(axes)
            self._number(axes, "white" if self.signals == "nodes" else style.BLACK)
        _frame(axes)

    @property
    def shown(self) -> Integers:
        """Numbers of the simplices that carry u and are drawn."""
        drawn = {"nodes": self._nodes, "links": self._links, "triangles": self._triangles}
        return drawn[self.signals]

    def draw_values(self, axes: Axes, values: Array, scale: Normalize, colours: str) -> Collection:
        """Draw the network with the values (N_k,) of what carries u as colours.

        The colours of what is returned are those of the values of `shown`.
        """
        look: dict[str, Any] = {"cmap": colours, "norm": scale}
        if self.signals == "nodes":
            self._add_links(axes, colors=_PALE)
            made = self._add_nodes(axes, c=values[self.shown], **look)
        else:
            self._add_background(axes)
            add = self._add_links if self.signals == "links" else self._add_faces
            made = add(axes, **look)
            made.set_array(values[self.shown])
        _frame(axes)
        return made

    def draw_nothing(self, axes: Axes) -> None:
        """Draw the network of a run that has no values."""
        self._add_background(axes)
        look: dict[str, Any] = {"ha": "center", "va": "top", "color": "#777777"}
        axes.text(0.5, 0.0, "does not oscillate", transform=axes.transAxes, **look)
        _frame(axes)

    def _add_background(self, axes: Axes) -> None:
        if self.signals != "links":
            self._add_links(axes, colors=_PALE)
        if self.network.n_nodes <= _FEW:
            self._add_nodes(axes, color="#777777", s=min(self._dot, 6.0))

    def _add_nodes(self, axes: Axes, **look: Any) -> Collection:
        x, y = self.places[self._nodes].T
        big = len(self._nodes) > _MANY
        given = {"s": self._dot, "zorder": 3.0, "linewidths": 0.0, "rasterized": big, **look}
        if not big and self.signals == "nodes":
            given |= {"edgecolors": style.BLACK, "linewidths": 0.3}
        made = axes.scatter(x, y, **given)
        made.set_in_layout(False)
        return made

    def _add_links(self, axes: Axes, **look: Any) -> Collection:
        carries = self.signals == "links"
        size = float(np.clip(20.0 / np.sqrt(max(1, len(self.chords))), 0.1, 0.9))
        width = 2.5 * size if carries else size
        alpha = 1.0 if carries else float(np.clip(400.0 / max(1, len(self.chords)), 0.1, 1.0))
        lines = LineCollection(list(self.chords), linewidths=width, alpha=alpha, zorder=2.0, **look)
        return _added(axes, lines, len(self.chords))

    def _add_faces(self, axes: Axes, **look: Any) -> Collection:
        colour = look.pop("colors", None)
        if colour is not None:
            look["facecolors"] = colour
        # Triangles share much of the plane: they are drawn apart, and let others through.
        centre = self.faces.mean(axis=1, keepdims=True)
        faces = centre + 0.86 * (self.faces - centre)
        made = PolyCollection(list(faces), linewidths=0.0, alpha=0.55, zorder=2.5, **look)
        return _added(axes, made, len(faces))

    def _add_arrows(self, axes: Axes) -> None:
        heads = arrow_heads(self.chords, 0.1)
        made = PolyCollection(list(heads), facecolors="#555555", linewidths=0.0, zorder=2.8)
        _added(axes, made, len(heads))

    def _number(self, axes: Axes, colour: str) -> None:
        lift = 0.0 if self.signals == "nodes" else 0.09
        for i, (x, y) in enumerate(self.places.tolist()):
            look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 5.5}
            axes.text(x, y + lift, str(i), color=colour, zorder=4.0, **look)

    @property
    def _dot(self) -> float:
        if self.is_small and self.signals == "nodes":
            return 62.0
        return float(np.clip(2600.0 / len(self._nodes), 1.5, 26.0))


def _feature(state: NetworkState, name: str) -> Array | None:
    if state.features is None:
        return None
    values: Array = np.asarray(state.features, dtype=np.float64)[FEATURES.index(name)]
    return values


def _scale(states: Sequence[NetworkState], name: str) -> Normalize:
    """Return the scale of a feature over all runs; one that hardly varies looks flat."""
    if name == "phase":
        return Normalize(-np.pi, np.pi)
    rows = [row for state in states if (row := _feature(state, name)) is not None]
    values = np.concatenate(rows) if rows else np.zeros(1)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.01 * max(abs(low), abs(high), 1e-9)
    return Normalize(low, high) if high - low > margin else Normalize(low - margin, high + margin)


def _added(axes: Axes, made: Collection, count: int) -> Collection:
    made.set_rasterized(count > _MANY)
    made.set_in_layout(False)  # frames are fixed; extents of many paths take long
    axes.add_collection(made, autolim=False)
    return made


def _frame(axes: Axes) -> None:
    axes.set_xlim(-1.14, 1.14)
    axes.set_ylim(-1.14, 1.14)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_axis_off()
