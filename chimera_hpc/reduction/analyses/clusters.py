"""Analyses of the clusters: how many classes there are, and what other classifiers say."""

from __future__ import annotations

from dataclasses import asdict
from itertools import combinations
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify import tree
from chimera_hpc.classify.agreement import adjusted_rand
from chimera_hpc.classify.class_number import class_number
from chimera_hpc.classify.classification import classify
from chimera_hpc.classify.classifiers import AGGLOMERATIVE, OTHERS, labels_by
from chimera_hpc.reduction.analysis_input import AnalysisInput, Array

_FEWEST = 10


def number_of_classes(given: AnalysisInput) -> dict[str, Any]:
    """Number of classes by gap statistic, silhouette and stability, see `classify.class_number`."""
    made = class_number(_points(given))
    return {
        **asdict(made),
        "by": {
            "gap statistic": made.by_gap,
            "silhouette": made.by_silhouette,
            "stability": made.by_stability,
        },
        "answer": made.answer,
        "sentence": made.sentence,
    }


def classifiers(given: AnalysisInput) -> dict[str, Any]:
    """Classes of the clustered runs by the job's classifier (first cut) and by the others.

    ``labels`` (n,) by classifier, -1 for a run in no class; sizes of the classes; and the adjusted
    Rand index of each pair of classifiers.
    """
    points = _points(given)
    scaled = tree.scale(points, tree.limits(points))
    n_classes = len(given.cut.names)
    own = given.sweep.reduction.classifier
    labels = {own: given.cut.labels[given.clustered]}
    if own != AGGLOMERATIVE:
        k, linkage = max(n_classes, 1), given.sweep.reduction.linkage
        tree_of = classify(points, given.status[given.clustered], linkage=linkage, cuts=(k,))
        labels[AGGLOMERATIVE] = tree_of.cuts[k].labels
    labels |= {name: labels_by(name, scaled, max(n_classes, 1)) for name in OTHERS if name != own}
    texts = {name: [None if x < 0 else str(x) for x in found] for name, found in labels.items()}
    whole = {name: np.full(len(given.status), -1) for name in labels}
    for name, found in labels.items():
        whole[name][given.clustered] = found
    return {
        "n_classes": n_classes,
        "labels": whole,
        "sizes": {name: np.bincount(found[found >= 0]) for name, found in labels.items()},
        "pairs": [
            {"rows": a, "columns": b, "adjusted_rand": adjusted_rand(texts[a], texts[b])}
            for a, b in combinations(labels, 2)
        ],
    }


def _points(given: AnalysisInput) -> Array:
    points: Array = given.triplets[given.clustered]
    if len(points) < _FEWEST:
        raise BadInput(f"{len(points)} runs with a triplet; at least {_FEWEST} are needed")
    return points
