"""Several methods on the same runs: confusion matrices, and the class of each cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.classify.agreement import comparable
from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput, numbers
from chimera_hpc.plot.modes import Parameters, draw_modal_classes

_SPOKEN = {
    "sigma_1": r"$\sigma_1$",
    "g0": "$g_0$",
    "g0_global": "$g_0$, all pairs",
    "acm": "ACM",
}
_MOST_MATRICES = 3


def spoken(name: str) -> str:
    """Return a measure's name as figures have it."""
    return _SPOKEN.get(name, name)


def agreement_figure(data: FigureInput) -> Figure | None:
    """Draw a confusion matrix for each of the first three pairs of methods that name classes."""
    entry = data.curves.get("agreement", {"pairs": ()})
    comparisons = [
        Comparison(spoken(p["rows"]), spoken(p["columns"]), entry["classes"], p["counts"])
        for p in entry["pairs"]
        if np.any(p["counts"])
    ]
    return confusion_matrices(comparisons[:_MOST_MATRICES]) if comparisons else None


def matrix_figure(data: FigureInput) -> Figure | None:
    """Draw how far each two methods agree on the runs, of more than two methods."""
    entry = data.curves.get("agreement")
    if entry is None or len(entry["modal"]) < 3:
        return None
    names = list(entry["modal"])
    values = np.full((len(names), len(names)), np.nan)
    for pair in entry["pairs"]:
        i, j = names.index(pair["rows"]), names.index(pair["columns"])
        values[j, i], values[i, j] = numbers([pair["kappa"], pair["adjusted_rand"]])
    return agreement_matrix([spoken(name) for name in names], values)


def verdicts_figure(data: FigureInput) -> Figure | None:
    """Draw the modal class of each cell by each method, and mark where they differ."""
    entry = data.curves.get("agreement")
    if entry is None or len(data.axes) not in (1, 2):
        return None
    methods: Methods = {spoken(name): classes for name, classes in entry["modal"].items()}
    if len(data.axes) == 2:
        return verdict_maps(data.axes, methods)
    label, x = data.axes[0]
    return verdicts(x, methods, label=label)


Methods = Mapping[str, Sequence[str | None]]
"""Class of each cell (k,) by the name of the method."""


@dataclass(frozen=True)
class Comparison:
    """Counts (k, k) of runs: rows are classes of one method, columns are classes of the other."""

    rows: str
    columns: str
    classes: Sequence[str]
    counts: ArrayLike


@style.styled
def confusion_matrices(comparisons: Sequence[Comparison]) -> Figure:
    """Draw one matrix for each pair of methods; the title gives the share of equal verdicts."""
    figure, axes = style.new_panels(len(comparisons), 2.5 * len(comparisons) + 0.5, 2.7)
    for frame, comparison in zip(axes, comparisons, strict=True):
        _draw_matrix(frame, comparison)
    style.letter(axes)
    return figure


def _draw_matrix(axes: Axes, comparison: Comparison) -> None:
    counts = np.asarray(comparison.counts, dtype=np.int64)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
    for (row, column), count in np.ndenumerate(counts):
        shade = "white" if share[row, column] > 0.5 else "black"
        axes.text(column, row, str(count), ha="center", va="center", color=shade)
    names = [style.drawn(name) for name in comparison.classes]
    axes.set_xticks(range(len(names)), names, rotation=20.0, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.set_xlabel(comparison.columns)
    axes.set_ylabel(comparison.rows)
    total = int(counts.sum())
    equal = f"{np.trace(counts) / total:.1%}" if total else "no runs"
    axes.set_title(f"agree: {equal}")


@style.styled
def verdicts(x: ArrayLike, methods: Methods, *, label: str = "$P$") -> Figure:
    """Draw each method's class for each cell x (k,) in a row; a bar marks where they differ.

    Methods with classes of their own, A or class-1, are drawn, but not compared.
    """
    values = np.asarray(x, dtype=np.float64)
    figure, (axes,) = style.new_panels(1, style.PAGE - 0.8, 1.1 + 0.36 * len(methods))
    compared = list(comparable(methods).values())
    differ = [len({classes[i] for classes in compared}) > 1 for i in range(len(values))]
    width = float(np.min(np.diff(np.unique(values)), initial=1.0))
    for position in values[differ]:
        axes.axvspan(position - 0.5 * width, position + 0.5 * width, color="#fbe7b2", linewidth=0.0)
    for row, classes in enumerate(methods.values()):
        for name in style.in_order(filter(None, classes)):
            chosen = values[[other == name for other in classes]]
            style.scatter_class(axes, chosen, np.full(len(chosen), row), name, 30.0)
    axes.set_yticks(range(len(methods)), list(methods))
    axes.set_ylim(len(methods) - 0.4, -0.6)
    style.set_ticks(axes.xaxis, values, nbins=12, integer=True)
    axes.set_xlabel(label)
    style.add_class_legend(figure, filter(None, chain(*methods.values())))
    return figure


@style.styled
def agreement_matrix(names: Sequence[str], values: ArrayLike) -> Figure:
    """Draw a matrix (k, k): kappa below the diagonal, adjusted Rand index above; NaN is white."""
    shown = np.asarray(values, dtype=np.float64)
    side = 1.6 + 0.5 * len(names)
    figure, (axes,) = style.new_panels(1, side + 0.6, side)
    image = axes.imshow(shown, cmap="RdBu", vmin=-1.0, vmax=1.0)
    for (row, column), value in np.ndenumerate(shown):
        if np.isfinite(value):
            shade = "white" if abs(value) > 0.6 else "black"
            axes.text(column, row, f"{value:.2f}", ha="center", va="center", color=shade)
    axes.set_xticks(range(len(names)), names, rotation=90.0)
    axes.set_yticks(range(len(names)), names)
    axes.set_title("below: Cohen's $\\kappa$, above: adjusted Rand index")
    figure.colorbar(image, ax=axes, shrink=0.8)
    return figure


@style.styled
def verdict_maps(parameters: Parameters, methods: Methods) -> Figure:
    """Draw each method's class over the plane of two parameters, and the share that is shared.

    The last panel is the share of methods, of those with a class, that give the most frequent one.
    Methods with classes of their own, A or class-1, do not count in it.
    """
    figure, axes = style.new_panels(len(methods) + 1, 2.1 * (len(methods) + 1), 2.6, sharey=True)
    for frame, (name, classes) in zip(axes, methods.items(), strict=False):
        draw_modal_classes(frame, parameters, classes)
        frame.set_title(name)
    (x_label, x), (y_label, y) = parameters
    across, column = np.unique(np.asarray(x, float), return_inverse=True)
    up, row = np.unique(np.asarray(y, float), return_inverse=True)
    shares = np.full((len(across), len(up)), np.nan)
    compared = list(comparable(methods).values())
    shares[column, row] = [_shared([one[i] for one in compared]) for i in range(len(row))]
    mesh = style.draw_shares(axes[-1], across, up, shares)
    style.set_ticks(axes[-1].xaxis, across)
    axes[-1].set_xlabel(x_label)
    axes[-1].set_title("share that agrees")
    for frame in axes[1:]:
        frame.set_ylabel("")
    axes[0].set_ylabel(y_label)
    figure.colorbar(mesh, ax=axes[-1])
    style.add_class_legend(figure, filter(None, chain(*methods.values())))
    return figure


def _shared(classes: Sequence[str | None]) -> float:
    known = Counter(filter(None, classes))
    return max(known.values()) / known.total() if known else float("nan")
