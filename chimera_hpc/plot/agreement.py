"""Several methods on the same runs: confusion matrices, and the class of each cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput

_SPOKEN = {"SI": "SI", "triplets": "triplets", "sigma_1": r"$\sigma_1$"}


def agreement_figure(data: FigureInput) -> Figure | None:
    """Draw a confusion matrix for each pair of methods."""
    entry = data.curves.get("agreement")
    if entry is None:
        return None
    comparisons = [
        Comparison(_SPOKEN[p["rows"]], _SPOKEN[p["columns"]], entry["classes"], p["counts"])
        for p in entry["pairs"]
    ]
    return confusion_matrices(comparisons)


def verdicts_figure(data: FigureInput) -> Figure | None:
    """Draw the modal class of each cell by each method, and mark where they differ."""
    entry = data.curves.get("agreement")
    if entry is None or data.only_axis is None:
        return None
    label, x = data.only_axis
    methods: Mapping[str, Sequence[str | None]] = {
        _SPOKEN[name]: classes for name, classes in entry["modal"].items()
    }
    return verdicts(x, methods, label=label)


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
def verdicts(
    x: ArrayLike, methods: Mapping[str, Sequence[str | None]], *, label: str = "$P$"
) -> Figure:
    """Draw each method's class for each cell x (k,) in a row; a bar marks where they differ."""
    values = np.asarray(x, dtype=np.float64)
    figure, (axes,) = style.new_panels(1, style.PAGE - 0.8, 1.1 + 0.36 * len(methods))
    differ = [len(set(column)) > 1 for column in zip(*methods.values(), strict=True)]
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
