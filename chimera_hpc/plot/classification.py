"""The whole classification in one figure: tree, plane, modal classes.

Paper fig:hvsnmin:orient:1, fig:orient1_5classes, fig:hvsnmin:orient:1tri, fig:ourmeth and others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.dendrogram import draw_dendrogram
from chimera_hpc.plot.modes import draw_class_against, draw_class_map
from chimera_hpc.plot.projections import draw_projection


@dataclass(frozen=True)
class ClassifiedRuns:
    """What panels (a) and (b) show: a cut of a tree, and the points behind it."""

    linkage: NDArray[np.float64]
    """(m - 1, 4), SciPy's"""
    leaf_labels: NDArray[np.int64]
    """(m,)"""
    names: Sequence[str]
    depth: float
    triplets: ArrayLike
    """(n, 3) V_theta, V_a, V_Omega"""
    labels: ArrayLike
    """(n,), -1 for points outside the classification"""


@style.styled
def classification_against(
    runs: ClassifiedRuns,
    x: ArrayLike,
    classes: Sequence[str | None],
    votes: Sequence[Mapping[str, int]] = (),
    *,
    label: str = "$P = Q$",
) -> Figure:
    """Draw tree, plane (V_theta, V_a) and modal class against a parameter."""
    figure, axes = _begin(runs)
    draw_class_against(axes[2], x, classes, votes, label=label)
    seen = [name for name in classes if name is not None]
    style.add_class_legend(figure, [*runs.names, *seen])
    return figure


@style.styled
def classification_map(
    runs: ClassifiedRuns,
    x: ArrayLike,
    y: ArrayLike,
    classes: Sequence[str | None],
    *,
    labels: tuple[str, str] = ("$P$", "$Q$"),
) -> Figure:
    """Draw tree, plane (V_theta, V_a) and modal class over a plane of parameters."""
    figure, axes = _begin(runs)
    draw_class_map(axes[2], x, y, classes, labels=labels)
    style.add_class_legend(figure, [*runs.names, *(name for name in classes if name is not None)])
    return figure


def _begin(runs: ClassifiedRuns) -> tuple[Figure, list[Axes]]:
    figure = style.new_figure(style.PAGE + 1.5, 2.9)
    axes = list(figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15)))
    draw_dendrogram(axes[0], runs.linkage, runs.leaf_labels, runs.names, runs.depth)
    draw_projection(axes[1], runs.triplets, runs.labels, runs.names)
    style.letter(axes)
    return figure, axes
