"""What the store keeps of a classification, in its group ``reduction``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.classify.atlas import Atlas, Variable
from chimera_hpc.classify.classification import Classification, Cut
from chimera_hpc.classify.modes import NO_WINDOW, STEADY, CellTable, modal_classes
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.run.rounds import Standing


def reduction_variables(
    points: CellTable, status: ArrayLike, classification: Classification
) -> tuple[dict[str, Variable], dict[str, Any]]:
    """Return variables (dimensions, values) and JSON attributes.

    ``linkage`` and ``members`` are the tree, ``cell`` is the cell of each point.
    For each cut k: ``labels_k`` over points, ``centroids_k``, and over cells ``modal_class_k``,
    ``votes_k`` and ``entropy_bits_k``; classes are positions in the attribute ``names_k``, which
    ends with steady and no_window, and -1 stands for none. The atlas of the base cut goes with it.
    """
    codes = np.asarray(status)
    variables: dict[str, Variable] = {
        "linkage": (("merge", "linkage_column"), classification.linkage),
        "members": (("leaf",), classification.members),
        "cell": (("point",), points.cells()[0]),
    }
    attributes: dict[str, Any] = {
        "method": classification.method,
        "classifier": classification.classifier,
        "sampled": classification.sampled,
        "variations": list(TRIPLET),
        "cuts": list(classification.cuts),
    }
    for asked, cut in classification.cuts.items():
        variables |= _cut_variables(points, codes, asked, cut)
        attributes[f"names_{asked}"] = [*cut.names, STEADY, NO_WINDOW]
        attributes[f"depth_{asked}"] = cut.depth
    atlas_variables, atlas_attributes = Atlas.of(classification).variables()
    return variables | atlas_variables, attributes | atlas_attributes


def decided_variables(now: Standing) -> tuple[dict[str, Variable], dict[str, Any]]:
    """Return the classes by which the cells of a sweep with [decide] are decided.

    ``labels_judge`` over points and ``modal_class_judge`` over cells are positions in the attribute
    ``names_judge``, -1 where there is none.
    """
    return {
        "labels_judge": (("point",), now.labels),
        "modal_class_judge": (("cell_number",), now.found.leader),
        "decided": (("cell_number",), now.found.decided),
    }, {"names_judge": list(now.names)}


def _cut_variables(
    points: CellTable, status: NDArray[np.int64], asked: int, cut: Cut
) -> dict[str, Variable]:
    names = [*cut.names, STEADY, NO_WINDOW]
    position = {name: i for i, name in enumerate(names)}
    cells = modal_classes(points, status, cut)
    modal = np.array([position.get(cell["class"], -1) for cell in cells], dtype=np.int64)
    votes = np.array([[cell["votes"].get(name, 0) for name in names] for cell in cells], np.int64)
    entropy = np.array([cell["entropy_bits"] for cell in cells], dtype=np.float64)
    return {
        f"labels_{asked}": (("point",), cut.labels),
        f"centroids_{asked}": ((f"class_{asked}", "variation"), cut.centroids),
        f"modal_class_{asked}": (("cell_number",), modal),
        f"votes_{asked}": (("cell_number", f"vote_{asked}"), votes.reshape(len(cells), len(names))),
        f"entropy_bits_{asked}": (("cell_number",), entropy),
    }
