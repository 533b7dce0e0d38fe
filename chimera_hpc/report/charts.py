"""The charts of a report: Bokeh figures whose sources the page's script fills and links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import (
    CDSView,
    ColumnDataSource,
    FixedTicker,
    HoverTool,
    IndexFilter,
    Range1d,
    TapTool,
)
from bokeh.models.annotations import Span
from bokeh.plotting import figure

MAP, TREE, PICTURE, NETWORK = "map", "tree", "picture", "network"
PROFILES = ("amplitude", "phase", "frequency")
PLANES = (("V_theta", "V_a"), ("V_theta", "V_Omega"), ("V_a", "V_Omega"))
_WORDS = {"V_theta": "V_θ", "V_a": "V_a", "V_Omega": "V_Ω", "phase": "phase (rad)"}
_WORDS |= {"frequency": "frequency (1/time)"}
_SHADES = ("fill", "alpha", "colour", "line", "marker")
_MOST_TICKS = 13
_INK, _GRID = "#1b1b1b", "#e4e4e4"
_BAND_LOOKS = (("#117733", "star"), ("#0057b8", "circle"), ("#aa3377", "square"))

Sources = dict[str, ColumnDataSource]


def sources() -> Sources:
    """Return the sources that charts share; the page's script fills them."""
    points = ("V_theta", "V_a", "V_Omega", "cell", "name", "class", "colour", "line", "marker")
    ends = [f"{name}{end}" for name in PROFILES for end in ("", "_low", "_high")]
    columns = {
        "cells": ("x", "y", "box", "name", "class", "votes", "entropy", "runs", *_SHADES, "size"),
        "bars": ("x", "bottom", "top", "colour", "hatch", "class", "name", "share"),
        "points": points,
        "merges": ("xs", "ys", "colour"),
        "leaves": ("x", "y", "colour", "line", "marker", "class", "runs"),
        "picture": ("url", "x", "y", "w", "h"),
        "profile": ("node", *ends),
        "behind": ("xs", "ys"),
        "marks": ("xs", "ys", "colour", "number", "value"),
    }
    return {
        name: ColumnDataSource({key: [] for key in keys}, name=f"source-{name}")
        for name, keys in columns.items()
    }


def cell_map(made: Sources, axes: Sequence[tuple[str, Sequence[str]]]) -> figure:
    """Return the phase diagram: cells over the first two axes, or votes along a single one.

    `axes` holds name and labels of values; positions along an axis count from 0. A filter named
    ``slice`` says which cells are shown, for sweeps of more axes.
    """
    (label, values), flat = axes[0], len(axes) < 2
    height = 330 if flat else int(np.clip(90 + 22 * len(axes[1][1]), 260, 720))
    plot = _figure(MAP, height, x_range=_span(len(values)), tools="box_zoom,reset,save")
    plot.max_width = max(360, 110 + 60 * len(values))
    plot.xaxis.axis_label = label
    _label_ticks(plot.xaxis, values)
    if flat:
        _draw_votes(plot, made["bars"])
    else:
        plot.y_range = _span(len(axes[1][1]))
        plot.yaxis.axis_label = axes[1][0]
        _label_ticks(plot.yaxis, axes[1][1])
    shown = CDSView(filter=IndexFilter(indices=[], name="slice"))
    boxes = plot.rect(
        *("x", "box"),
        width=0.96,
        height=1.32 if flat else 0.96,
        source=made["cells"],
        view=shown,
        fill_color="fill",
        fill_alpha="alpha",
        line_color=None,
    )
    _outline_selected(boxes)
    signs = _scatter(plot, made["cells"], ("x", "y"), size="size", view=shown)
    signs.nonselection_glyph = signs.glyph.clone()
    lines = [("", "@name"), ("class", "@class"), ("votes", "@votes"), ("entropy", "@entropy bits")]
    plot.add_tools(
        HoverTool(renderers=[boxes], tooltips=[*lines, ("runs", "@runs")]),
        TapTool(renderers=[boxes]),
    )
    return plot


def _draw_votes(plot: figure, bars: ColumnDataSource) -> None:
    """Draw the votes of cells along one axis as stacked bars, with room above for a sign each."""
    plot.y_range = _range(-0.02, 1.32)
    plot.yaxis.axis_label = "share of votes"
    plot.yaxis.ticker = FixedTicker(ticks=[0.0, 0.25, 0.5, 0.75, 1.0])
    plot.vbar(
        *("x", 0.8, "top", "bottom"),
        source=bars,
        fill_color="colour",
        fill_alpha=0.75,
        line_color="white",
        hatch_pattern="hatch",
        hatch_color="white",
        hatch_alpha=0.5,
        hatch_scale=8,
    )


def tree(made: Sources, height: float, n_leaves: int) -> figure:
    """Return the dendrogram's upper part with the line of the cut, a Span named ``cut``."""
    plot = _figure(TREE, 330, x_range=_span(max(n_leaves, 1)), tools="reset,save")
    plot.y_range = _range(-0.06 * height, 1.06 * height)
    plot.xaxis.visible = False
    plot.xgrid.visible = False
    plot.yaxis.axis_label = "depth d (scaled units)"
    plot.multi_line("xs", "ys", source=made["merges"], line_color="colour", line_width=1.4)
    leaves = _scatter(plot, made["leaves"], ("x", "y"), size=8)
    plot.add_tools(
        HoverTool(renderers=[leaves], tooltips=[("class", "@class"), ("runs below", "@runs")])
    )
    line = Span(location=height, dimension="width", name="cut", line_width=1.5)
    line.update(line_color=_INK, line_dash="dashed")
    plot.add_layout(line)
    return plot


def projections(made: Sources, largest: Mapping[str, float]) -> dict[str, figure]:
    """Return the planes of the three variations; a selection in one is one in all.

    `largest` holds the largest value of each variation; the smallest possible is 0.
    """
    plots = {}
    for i, (across, up) in enumerate(PLANES):
        name = f"plane{i}"
        plot = _figure(name, 300, tools="box_select,lasso_select,tap,box_zoom,reset")
        plot.x_range, plot.y_range = (
            _range(-0.04 * (largest[n] or 1.0), 1.04 * (largest[n] or 1.0)) for n in (across, up)
        )
        plot.xaxis.axis_label, plot.yaxis.axis_label = _WORDS[across], _WORDS[up]
        runs = _scatter(plot, made["points"], (across, up), size=7, alpha=0.75)
        runs.nonselection_glyph.update(fill_alpha=0.08, line_alpha=0.08, hatch_alpha=0.08)
        tooltips = [("", "@name"), ("class", "@class")]
        plot.add_tools(HoverTool(renderers=[runs], tooltips=tooltips))
        plots[name] = plot
    return plots


def picture(made: Sources, n_nodes: int, label: str) -> figure:
    """Return the frame for the space-time picture of a run; `label` is that of its nodes."""
    plot = _figure(PICTURE, 460, x_range=_range(0.0, 1.0), tools="box_zoom,reset,save")
    plot.y_range = _range(-0.5, n_nodes - 0.5)
    plot.xaxis.axis_label, plot.yaxis.axis_label = "time t", label
    plot.grid.visible = False
    plot.image_url("url", "x", "y", "w", "h", source=made["picture"], anchor="bottom_left")
    return plot


def network(made: Sources, signals: str) -> figure:
    """Return the frame for the network of a run, which the page's script fills and colours.

    signals: where u lives; nodes are dots, links lines and triangles areas.
    """
    plot = _figure(NETWORK, 400, match_aspect=True, tools="box_zoom,reset,save,pan,wheel_zoom")
    plot.x_range, plot.y_range = _range(-1.1, 1.1), _range(-1.1, 1.1)
    plot.max_width = 480
    plot.axis.visible = plot.grid.visible = False
    plot.multi_line("xs", "ys", source=made["behind"], line_color="#c4c4c4", line_width=0.8)
    draw: Any  # bokeh types each of its many keywords
    draw, look = {
        "nodes": (plot.scatter, {"size": 9, "fill_color": "colour", "line_color": _INK}),
        "links": (plot.multi_line, {"line_color": "colour", "line_width": 3}),
        "triangles": (
            plot.patches,
            {"fill_color": "colour", "fill_alpha": 0.55, "line_color": None},
        ),
    }[signals]
    marks = draw("xs", "ys", source=made["marks"], **look)
    word = signals.removesuffix("s")
    plot.add_tools(HoverTool(renderers=[marks], tooltips=[(word, "@number"), ("", "@value")]))
    return plot


def profiles(made: Sources, n_nodes: int, label: str) -> dict[str, figure]:
    """Return the profiles of the Fourier features over the nodes, plus and minus one deviation."""
    plots = {}
    for name in PROFILES:
        plot = _figure(name, 200, x_range=_range(-1.0, n_nodes), tools="box_zoom,reset")
        plot.y_range = _range(0.0, 1.0)
        plot.xaxis.axis_label, plot.yaxis.axis_label = label, _WORDS.get(name, name)
        ends = ("node", f"{name}_low", "node", f"{name}_high")
        plot.segment(*ends, source=made["profile"], line_color="#7a7a7a")
        plot.scatter("node", name, source=made["profile"], size=5, color="#0057b8")
        plots[name] = plot
    return plots


def robustness(entries: Mapping[str, Mapping[str, Any]], axis: str) -> figure:
    """Return shares of chimeras with their bands; `entries` as in results.json's ``curves``."""
    plot = _figure("robustness", 340, tools="box_zoom,reset,save", y_range=_range(-0.03, 1.03))
    plot.xaxis.axis_label, plot.yaxis.axis_label = axis, "share of chimeras W"
    for i, (label, curve) in enumerate(entries.items()):
        colour, marker = _BAND_LOOKS[i % len(_BAND_LOOKS)]
        names = ("x", "fraction", "low", "high")
        band = ColumnDataSource({n: np.array(curve[n], dtype=np.float64) for n in names})
        plot.varea("x", "low", "high", source=band, fill_color=colour, fill_alpha=0.18)
        plot.line("x", "fraction", source=band, line_color=colour, legend_label=label)
        dots = plot.scatter(
            *("x", "fraction"), source=band, marker=marker, size=7, color=colour, legend_label=label
        )
        tooltips = [(axis, "@x"), ("W", "@fraction{0.000}"), ("band", "@low{0.00} - @high{0.00}")]
        plot.add_tools(HoverTool(renderers=[dots], tooltips=tooltips))
    plot.legend.location = "top_right"
    plot.legend.background_fill_alpha = 0.8
    return plot


def hysteresis(chains: Sequence[Mapping[str, Any]], along: str, order: str) -> figure:
    """Return the order parameter along each chain, with the classes as tooltips.

    `chains` as in results.json.
    """
    plot = _figure("hysteresis", 340, tools="box_zoom,reset,save")
    plot.xaxis.axis_label, plot.yaxis.axis_label = along, order.replace("_", " ")
    for chain in chains:
        colour, marker = _BAND_LOOKS[chain["direction"] == "backward"]
        columns = {"x": chain["values"], "order": chain["order"], "class": chain["classes"]}
        source = ColumnDataSource({name: list(values) for name, values in columns.items()})
        look = {"color": colour, "legend_label": chain["direction"]}
        plot.line("x", "order", source=source, line_alpha=0.6, **look)
        dots = plot.scatter("x", "order", source=source, marker=marker, size=6, **look)
        tooltips = [(along, "@x"), (order, "@order{0.0000}"), ("class", "@class")]
        plot.add_tools(HoverTool(renderers=[dots], tooltips=tooltips))
    legend = plot.legend[0]
    legend.orientation, legend.spacing, legend.border_line_color = "horizontal", 20, None
    plot.add_layout(legend, "above")  # inside it would hide points of either direction
    return plot


def _figure(name: str, height: int, **options: Any) -> figure:
    plot = figure(
        name=name,
        height=height,
        sizing_mode="stretch_width",
        min_width=120,
        output_backend="canvas",
        toolbar_location="above",
        **options,
    )
    plot.toolbar.logo = None
    # Dragging is left to the page, which a finger scrolls so; a tool is chosen first.
    plot.toolbar.active_drag = None
    plot.grid.grid_line_color = _GRID
    plot.outline_line_color = "#9a9a9a"
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = _INK
    return plot


def _scatter(
    plot: figure, source: ColumnDataSource, columns: tuple[str, str], **options: Any
) -> Any:
    return plot.scatter(
        *columns,
        source=source,
        marker="marker",
        fill_color="colour",
        line_color="line",
        line_width=1.2,
        **options,
    )


def _outline_selected(boxes: Any) -> None:
    boxes.selection_glyph = boxes.glyph.clone(line_color=_INK, line_width=3, line_alpha=1.0)
    boxes.nonselection_glyph = boxes.glyph.clone()


def _range(start: float, end: float) -> Range1d:
    return Range1d(start=start, end=end)


def _span(n: int) -> Range1d:
    return _range(-0.5, n - 0.5)


def _label_ticks(axis: Any, values: Sequence[str]) -> None:
    """Label about a dozen positions with the values that stand there."""
    step = -(-len(values) // _MOST_TICKS)
    ticks = list(range(0, len(values), step))
    axis.ticker = FixedTicker(ticks=ticks)
    axis.major_label_overrides = {i: values[i] for i in ticks}
