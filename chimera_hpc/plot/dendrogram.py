"""The tree of merges with the line that cuts it (paper fig. 5, panel a)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.cluster import hierarchy

from chimera_hpc.base.wording import number_of
from chimera_hpc.classify.classification import Classification, Cut
from chimera_hpc.classify.classifiers import AGGLOMERATIVE
from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput

_STEM = "#777777"


def dendrogram_figure(data: FigureInput, n_clusters: int) -> Figure | None:
    """Draw the tree with the line of a cut (paper fig. 5 a)."""
    tree, cut = data.classification, data.classification.cuts[n_clusters]
    if len(tree.members) < 2:
        return None
    n_runs = int(np.count_nonzero(cut.labels >= 0))
    labels = cut.labels[tree.members]
    return dendrogram(tree.linkage, labels, cut.names, height_of(tree, cut), n_runs)


def height_of(tree: Classification, cut: Cut) -> float:
    """Return the height of the line that makes a cut; NaN if no line does."""
    return cut.depth if tree.classifier == AGGLOMERATIVE else float("nan")


@style.styled
def dendrogram(
    linkage: NDArray[np.float64],
    leaf_labels: NDArray[np.int64],
    names: Sequence[str],
    depth: float,
    n_runs: int = 0,
) -> Figure:
    """Draw the tree of m leaves with its classes coloured; arguments as in `draw_dendrogram`."""
    figure, (axes,) = style.new_panels(1, style.COLUMN + 0.6, 2.9)
    draw_dendrogram(axes, linkage, leaf_labels, names, depth, n_runs)
    style.add_class_legend(figure, names)
    return figure


def draw_dendrogram(
    axes: Axes,
    linkage: NDArray[np.float64],
    leaf_labels: NDArray[np.int64],
    names: Sequence[str],
    depth: float,
    n_runs: int = 0,
) -> None:
    """Draw every merge as a bracket, in its class's colour below the cut, and the cut as a line.

    linkage (m - 1, 4) is SciPy's; leaf_labels (m,) index `names`; depth is the height of the line,
    NaN for none; n_runs is the number of runs if the leaves are a sample of them.
    """
    segments, owner = brackets(linkage, leaf_labels)
    for label in range(-1, len(names)):
        chosen = segments[owner == label]
        colour = style.colour_of(names[label]) if label >= 0 else _STEM
        lines = LineCollection(list(chosen), colors=colour, linewidths=0.7, capstyle="butt")
        lines.set_rasterized(len(chosen) > 2000)
        lines.set_label(style.drawn(names[label]) if label >= 0 else "above the cut")
        axes.add_collection(lines)
    if np.isfinite(depth):
        axes.axhline(depth, color="black", linewidth=0.9, linestyle="--", label="cut")
    top = np.nanmax([linkage[:, 2].max(initial=0.0), depth, 1e-12])
    n_places = max(len(leaf_labels), 1)
    axes.set_xlim(-0.01 * n_places - 0.5, 1.01 * n_places - 0.5)
    axes.set_ylim(0.0, 1.05 * top)
    axes.set_xticks([])
    sample = f"sample of {len(leaf_labels)} of " if n_runs > len(leaf_labels) else ""
    axes.set_xlabel(sample + number_of(n_runs or len(leaf_labels), "run"), labelpad=6.0)
    axes.set_ylabel("depth $d$ (scaled units)")
    # Beside the panel's letter: at the line itself it would cover branches.
    words = f"cut at $d$ = {depth:.3g}" if np.isfinite(depth) else "classes without the tree"
    axes.set_title(words, loc="right", fontsize="medium")


def brackets(
    linkage: NDArray[np.float64], leaf_labels: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the bracket of each merge as four corners (m - 1, 4, 2), and its class or -1.

    The class of a merge is that of all its leaves; -1 where they differ.
    """
    n_leaves = len(leaf_labels)
    if n_leaves < 2:
        return np.empty((0, 4, 2)), np.empty(0, dtype=np.int64)
    place = np.empty(2 * n_leaves - 1)
    place[hierarchy.leaves_list(linkage)] = np.arange(n_leaves)
    height = np.concatenate([np.zeros(n_leaves), linkage[:, 2]])
    label = np.concatenate([leaf_labels, np.empty(n_leaves - 1, dtype=np.int64)])
    corners = np.empty((n_leaves - 1, 4, 2))
    for row, (left, right) in enumerate(linkage[:, :2].astype(np.int64)):
        node = n_leaves + row
        place[node] = 0.5 * (place[left] + place[right])
        label[node] = label[left] if label[left] == label[right] else -1
        corners[row, :, 0] = place[[left, left, right, right]]
        corners[row, :, 1] = height[[left, node, node, right]]
    return corners, label[n_leaves:]
