"""Space-time plots of u: node against time (paper fig. 3, fig. 16 and others)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import DrawnRun, FigureInput
from chimera_hpc.plot.ordered import OrderedRows, in_order
from chimera_hpc.plot.raster import NodeSeries, Raster, close_up, overview

Panel = tuple[ArrayLike, NodeSeries]
"""Times (T,), uniform, and u (N, T)."""

_DOTS = 1000
"""Dots over the width of a page."""
_COLUMNS = 3
"""Most panels side by side."""


@dataclass(frozen=True)
class PanelRasters:
    """What is drawn of one run: a small part of its series, which is not needed any more."""

    overview: Raster
    close_up: Raster | None
    """Drawn if the overview of any run is coarse."""
    is_ordered: bool = False
    """Whether rows are in the order of a network."""
    bounds: tuple[int, ...] = ()
    """Rows at which another community begins."""

    @property
    def is_coarse(self) -> bool:
        """Whether the overview does not show every node and oscillation."""
        return self.overview.is_range or bool(self.overview.partly)


def panel_rasters(t: ArrayLike, u: NodeSeries, count: int) -> PanelRasters:
    """Return what `draw_panels` draws of t (T,), uniform, and u (N, T), one run of `count`."""
    upper = overview(t, u, _DOTS // _columns(count))
    return _rasters(u, upper, close_up(t, u, counted=upper.periods))


def space_time_figure(data: FigureInput) -> Figure | None:
    """Draw u over node and time for the runs to show, with a close-up (paper fig. 3)."""
    return _of_runs(data.shown) if data.shown else None


def whole_run_figure(data: FigureInput) -> Figure | None:
    """Draw u from t = 0 on for the runs to replay (paper fig. 12)."""
    return _of_runs(data.whole) if data.whole else None


def _of_runs(runs: Sequence[DrawnRun]) -> Figure:
    panels = [(run.t, in_order(run.u, run.network, run.signals)) for run in runs]
    return space_time(panels, [run.title for run in runs], signals=runs[0].signals)


def space_time(
    panels: Sequence[Panel],
    titles: Sequence[str] = (),
    *,
    columns: int = _COLUMNS,
    symbol: str = "u_i(t)",
    names: Sequence[str] = (),
    signals: str = "nodes",
) -> Figure:
    """Draw one panel for each (t, u): t (T,) uniform, u (N, T); one colour scale for all.

    If a series has more periods than a panel can show, the panel shows the range of u in each
    period, and a panel below it shows the last twelve periods of the run. `names` (N,) of the nodes
    label their axis. The default is their numbers from 0. `signals` says where u lives, "nodes",
    "links" or "triangles". Of `OrderedRows`, lines show where another community begins.
    """
    dots = _DOTS // _columns(len(panels), columns)
    made = [_rasters(u, overview(t, u, dots)) for t, u in panels]
    if any(panel.is_coarse for panel in made):
        near = [
            close_up(t, u, counted=panel.overview.periods)
            for (t, u), panel in zip(panels, made, strict=True)
        ]
        made = [replace(panel, close_up=raster) for panel, raster in zip(made, near, strict=True)]
    return draw_panels(made, titles, columns, symbol, names, signals)


@style.styled
def draw_panels(
    panels: Sequence[PanelRasters],
    titles: Sequence[str] = (),
    columns: int = _COLUMNS,
    symbol: str = "u_i(t)",
    names: Sequence[str] = (),
    signals: str = "nodes",
) -> Figure:
    """Draw one panel for each run, as `space_time` does."""
    columns = _columns(len(panels), columns)
    upper = [panel.overview for panel in panels]
    coarse = any(panel.is_coarse for panel in panels)
    lower = [panel.close_up for panel in panels if panel.close_up is not None and coarse]
    rows, parts = -(-len(panels) // columns), 2 if coarse else 1
    width = style.PAGE if columns > 1 else style.COLUMN + 1.2
    figure = style.new_figure(width, 0.35 + (2.05 if coarse else 1.95) * rows * parts)
    axes = figure.subplots(rows * parts, columns, squeeze=False)
    place = [(parts * (i // columns), i % columns) for i in range(len(panels))]
    scales = {kind: _largest((*upper, *lower), kind) for kind in (False, True)}
    for frame in axes.flat:
        frame.set_axis_off()
    for i, (row, column) in enumerate(place):
        lines = [titles[i] if i < len(titles) else "", upper[i].partly]
        axes[row, column].set_title("\n".join(filter(None, lines)))
        draw_raster(axes[row, column], upper[i], scales[upper[i].is_range], names)
        if coarse:
            axes[row + 1, column].set_title(lower[i].length, loc="left", fontsize="small")
            draw_raster(axes[row + 1, column], lower[i], scales[False], names)
        for frame, raster in zip(axes[row:, column], (upper[i], *lower[i : i + 1]), strict=False):
            _draw_bounds(frame, panels[i].bounds, raster)
    ordered = any(panel.is_ordered for panel in panels)
    for left in axes[:, 0]:
        left.set_ylabel("node" if names else style.signal_label(signals, ordered))
    for i, (row, column) in enumerate(place):
        if i + columns >= len(panels):
            axes[row + parts - 1, column].set_xlabel("time $t$")
    _add_bars(figure, axes, symbol, apart=coarse and rows == 1)
    style.letter([axes[here] for here in place])
    return figure


def draw_raster(axes: Axes, raster: Raster, largest: float, names: Sequence[str] = ()) -> AxesImage:
    """Draw dots, time along x and node 0 at the bottom; u has colours from -largest to largest.

    A range has other colours, from 0 to largest.
    """
    axes.set_axis_on()
    # Few labels, so that those of neighbouring panels stay apart.
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], integer=True))
    image = axes.imshow(
        raster.values,
        aspect="auto",
        origin="lower",
        extent=(*raster.times, raster.nodes[0] - 0.5, raster.nodes[1] - 0.5),
        vmin=0.0 if raster.is_range else -largest,
        vmax=largest,
        cmap="magma" if raster.is_range else "viridis",
        interpolation_stage="data",
    )
    if names:
        style.name_nodes(axes.yaxis, names[: raster.nodes[1]])
    return image


def _columns(count: int, most: int = _COLUMNS) -> int:
    """Return how many of `count` panels are side by side."""
    return 2 if count == 4 and most > 2 else min(most, count)


def _rasters(u: NodeSeries, upper: Raster, lower: Raster | None = None) -> PanelRasters:
    is_ordered = isinstance(u, OrderedRows)
    return PanelRasters(upper, lower, is_ordered, u.bounds if isinstance(u, OrderedRows) else ())


def _draw_bounds(axes: Axes, bounds: Sequence[int], raster: Raster) -> None:
    """Draw a line where another community begins."""
    for bound in bounds:
        if bound < raster.nodes[1]:
            axes.axhline(bound - 0.5, color="white", linewidth=0.7)


def _largest(rasters: Iterable[Raster], is_range: bool) -> float:
    """Return the largest absolute value of u, or of its range."""
    values = [raster.values for raster in rasters if raster.is_range == is_range]
    return max((float(np.nanmax(np.abs(v), initial=0.0)) for v in values), default=0.0) or 1.0


def _add_bars(figure: Figure, axes: NDArray[Any], symbol: str, apart: bool) -> None:
    """Add a colour bar for u and one for its range, next to all panels or next to their own row."""
    labels = {"viridis": f"${symbol}$", "magma": f"range of ${symbol}$ in a period"}
    images = [frame.images[0] for frame in axes.flat if frame.images]
    kinds = {image.get_cmap().name: image for image in images}
    for name in sorted(kinds):
        parents = axes[0 if name == "magma" else 1] if apart and len(kinds) > 1 else axes
        figure.colorbar(kinds[name], ax=parents, label=labels[name], fraction=0.03, pad=0.01)
