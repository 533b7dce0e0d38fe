"""The figures of a sweep: from an `Outcome` to a matplotlib figure, by name.

For developers: a figure is a function here that takes an `Outcome` (and the number of clusters,
where it shows one cut) and returns the figure, or None where the sweep has nothing for it to show;
one line in `FIGURES` or `CUT_FIGURES`; and its name in `grid.selection`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chimera_hpc.job.selection import split_figure_name
from chimera_hpc.plot.classification import (
    ClassifiedRuns,
    classification_against,
    classification_map,
)
from chimera_hpc.plot.curves import CURVE_FIGURES
from chimera_hpc.plot.dendrogram import dendrogram
from chimera_hpc.plot.indicators import fourier_indicators, profiles_of
from chimera_hpc.plot.modes import class_against, class_map
from chimera_hpc.plot.outcome import Outcome, Run
from chimera_hpc.plot.projections import projections
from chimera_hpc.plot.spacetime import space_time

Array = NDArray[np.float64]

Maker = Callable[[Outcome], Figure | None]
CutMaker = Callable[[Outcome, int], Figure | None]


def draw_space_time(outcome: Outcome) -> Figure | None:
    """Draw u over node and time for the runs to show, with a close-up (paper fig:9dyn)."""
    if not outcome.shown:
        return None
    panels = [(run.t, run.u) for run in outcome.shown]
    titles = [run.title for run in outcome.shown]
    fast = any(run.is_fast for run in outcome.shown)
    zoom = [run.close_up for run in outcome.shown] if fast else None
    return space_time(panels, titles, zoom=zoom)


def draw_indicators(outcome: Outcome) -> Figure | None:
    """Draw the Fourier indicators of the runs to show that oscillate (paper fig:9fourier)."""
    runs = [(run, run.features) for run in outcome.shown if run.features is not None]
    if not runs:
        return None
    titles = [f"{run.title}{_variations(run)}" for run, _ in runs]
    return fourier_indicators([profiles_of(features) for _, features in runs], titles)


def draw_whole_run(outcome: Outcome) -> Figure | None:
    """Draw u from t = 0 on for the runs to replay (paper fig:dynamics_P=1)."""
    if not outcome.whole:
        return None
    panels = [(run.t, run.u) for run in outcome.whole]
    return space_time(panels, [run.title for run in outcome.whole])


def draw_dendrogram(outcome: Outcome, n_clusters: int) -> Figure | None:
    """Draw the tree with the line of a cut (paper fig:hvsnmin:orient:1 a)."""
    runs = _classified(outcome, n_clusters)
    if runs is None:
        return None
    return dendrogram(runs.linkage, runs.leaf_labels, runs.names, runs.depth)


def draw_projections(outcome: Outcome, n_clusters: int) -> Figure | None:
    """Draw the three planes of variations and a view in 3-D (paper fig:hvsnmin:orient:13D)."""
    cut = outcome.classification.cuts[n_clusters]
    return projections(outcome.triplets, cut.labels, cut.names) if cut.names else None


def draw_modal_classes(outcome: Outcome, n_clusters: int) -> Figure | None:
    """Draw the modal class against the one parameter that varies, or over the plane of two."""
    cells, axes = outcome.cells[n_clusters], outcome.axes
    classes = [cell["class"] for cell in cells]
    if len(axes) == 1 and any(classes):
        return class_against(axes[0][1], classes, _votes(cells), label=axes[0][0])
    if len(axes) == 2 and any(classes):
        return class_map(axes[0][1], axes[1][1], classes, labels=(axes[0][0], axes[1][0]))
    return None


def draw_classification(outcome: Outcome, n_clusters: int) -> Figure | None:
    """Draw tree, plane (V_theta, V_a), modal classes in a row (paper fig:hvsnmin:orient:1)."""
    runs, cells, axes = _classified(outcome, n_clusters), outcome.cells[n_clusters], outcome.axes
    classes = [cell["class"] for cell in cells]
    if runs is None:
        return None
    if len(axes) == 1:
        return classification_against(runs, axes[0][1], classes, _votes(cells), label=axes[0][0])
    if len(axes) == 2:
        labels = (axes[0][0], axes[1][0])
        return classification_map(runs, axes[0][1], axes[1][1], classes, labels=labels)
    return None


FIGURES: dict[str, Maker] = {
    "space_time": draw_space_time,
    "indicators": draw_indicators,
    "whole_run": draw_whole_run,
    **CURVE_FIGURES,
}
CUT_FIGURES: dict[str, CutMaker] = {
    "dendrogram": draw_dendrogram,
    "projections": draw_projections,
    "modal_classes": draw_modal_classes,
    "classification": draw_classification,
}


def choose(asked: str | Sequence[str], cuts: Sequence[int]) -> dict[str, Maker | None]:
    """Return by file name what draws each figure that is asked for.

    "auto" asks for all figures: those of a cut for the first of `cuts`, and the composite figure
    for every one. A name without a number is for every cut. None stands for a figure of a cut that
    the sweep does not have.
    """
    if isinstance(asked, str):
        first = [f"{name}_{k}" for name in CUT_FIGURES for k in cuts[:1]]
        asked = [*FIGURES, *first, *(f"classification_{k}" for k in cuts[1:])]
    chosen: dict[str, Maker | None] = {}
    for name in asked:
        if name in FIGURES:
            chosen[name] = FIGURES[name]
            continue
        base, number = split_figure_name(name)
        draw = CUT_FIGURES[base]
        for k in cuts if number is None else [number]:
            chosen[f"{base}_{k}"] = _of_cut(draw, k) if k in cuts else None
    return chosen


def is_figure_name(stem: str) -> bool:
    """Whether a file of this name, without suffix, may be one of these figures."""
    base, number = split_figure_name(stem)
    return stem in FIGURES or (number is not None and base in CUT_FIGURES)


def _of_cut(draw: CutMaker, n_clusters: int) -> Maker:
    return lambda outcome: draw(outcome, n_clusters)


def _classified(outcome: Outcome, n_clusters: int) -> ClassifiedRuns | None:
    tree, cut = outcome.classification, outcome.classification.cuts[n_clusters]
    if len(tree.members) < 2:
        return None
    return ClassifiedRuns(
        linkage=tree.linkage,
        leaf_labels=cut.labels[tree.members],
        names=cut.names,
        depth=cut.depth,
        triplets=outcome.triplets,
        labels=cut.labels,
    )


def _votes(cells: Sequence[Mapping[str, Any]]) -> list[Mapping[str, int]]:
    return [cell["votes"] for cell in cells]


def _variations(run: Run) -> str:
    if run.triplet is None:
        return ""
    return f"\n$V$ = ({', '.join(f'{value:.3f}' for value in run.triplet)})"
