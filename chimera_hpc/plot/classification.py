"""The whole classification in one figure: tree, plane, modal classes.

Paper figs. 5, 6, 14, 20 and others.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from chimera_hpc.plot import style
from chimera_hpc.plot.dendrogram import draw_dendrogram, height_of
from chimera_hpc.plot.figure_input import FigureInput
from chimera_hpc.plot.modes import draw_modal_classes, vote_handles
from chimera_hpc.plot.projections import draw_projection


@style.styled
def classification_figure(data: FigureInput, n_clusters: int) -> Figure | None:
    """Draw tree, plane (V_theta, V_a), modal classes in a row (paper fig. 5)."""
    tree, classes = data.classification, data.classes(n_clusters)
    if len(tree.members) < 2 or len(data.axes) not in (1, 2):
        return None
    cut = tree.cuts[n_clusters]
    figure = style.new_figure(style.PAGE + 1.5, 2.9)
    axes = list(figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15)))
    leaf_labels, n_runs = cut.labels[tree.members], int(np.count_nonzero(cut.labels >= 0))
    draw_dendrogram(axes[0], tree.linkage, leaf_labels, cut.names, height_of(tree, cut), n_runs)
    draw_projection(axes[1], data.triplets, cut.labels, cut.names)
    axes[2].set_title(data.judged_elsewhere)
    style.letter(axes)
    draw_modal_classes(axes[2], data.axes, classes, data.votes(n_clusters))
    discs = vote_handles() if len(data.axes) == 1 else []
    style.add_class_legend(figure, [*cut.names, *filter(None, classes)], discs)
    return figure
