"""How reliable the classes of a tree are: trees of a sample, cuts between equal merges."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.class_number import class_number
from chimera_hpc.classify.classification import Classification
from chimera_hpc.classify.classifiers import AGGLOMERATIVE
from chimera_hpc.classify.naming import CLASSES
from chimera_hpc.classify.tree import relative_gap

CLOSE_MERGES = 0.02
"""Relative gap of two merge heights below which a cut between them is called unstable."""


ENOUGH = 30
"""Smallest number of runs for which the estimated number of classes is reported."""


def tree_warnings(made: Classification) -> list[str]:
    """Return a line if the tree holds a sample only, and one for each cut that is unstable."""
    return [*_of_sample(made), *_of_cuts(made)]


def counted(triplets: NDArray[np.float64], made: Classification) -> list[str]:
    """Return a line if the runs look like one state, or like another number than all cuts have.

    The latter is said of neutral classes only: the paper's three have names of their own. Of fewer
    than `ENOUGH` runs, nothing is said.
    """
    clustered = made.base.labels >= 0
    if np.count_nonzero(clustered) < ENOUGH:
        return []
    found = class_number(triplets[clustered])
    if found.answer == 1:
        return [f"{found.sentence}: the classes are parts of one cloud"]
    sizes = {len(cut.names) for cut in made.cuts.values()}
    if found.answer in sizes or set(made.base.families) & set(CLASSES):
        return []
    return [f"{found.sentence}, and no cut has so many: add {found.answer} to reduction.cuts"]


def runs_with_class(made: Classification) -> int:
    """Return the number of runs that have a class, in the tree or by their nearest leaf."""
    return int(np.count_nonzero(made.base.labels >= 0))


def _of_sample(made: Classification) -> Iterator[str]:
    if made.sampled:
        yield (
            f"the tree holds a sample of {len(made.members)} of {runs_with_class(made)} runs, and "
            f"each other run has the class of the nearest run in it: classes of the full tree "
            f"may differ, in cuts of many clusters most"
        )


def _of_cuts(made: Classification) -> Iterator[str]:
    for asked, cut in made.cuts.items() if made.classifier == AGGLOMERATIVE else ():
        gap = relative_gap(made.linkage, len(cut.names))
        if gap < CLOSE_MERGES:
            yield (
                f"the cut into {asked} clusters is unstable: the merges above and below it differ "
                f"by {100 * gap:.2g} % in height (below {CLOSE_MERGES:.0%}), so other seeds may "
                f"split another class; a cut of fewer or more clusters may be firmer"
            )
