"""Names of clusters: a rule for the base cut, inheritance along the tree for all others."""

from __future__ import annotations

from collections.abc import Sequence
from string import ascii_uppercase
from typing import TYPE_CHECKING

import numpy as np

from chimera_hpc.base.errors import BadInput

if TYPE_CHECKING:  # SciPy's trees take half a second, and commands that only name classes none
    from chimera_hpc.classify.tree import Floats, Integers

CLASSES = ("ordered", "chimera", "disordered")
STEADY, NO_WINDOW = "steady", "no_window"
RESERVED = frozenset({STEADY, NO_WINDOW})
TRIPLET, LETTERS = "triplet", "letters"
Rule = str | Sequence[str]
"""`TRIPLET`, the paper's rule; `LETTERS`, A, B, C, ...; or names by increasing V_theta."""


def base_size(rule: Rule, cuts: Sequence[int] = ()) -> int:
    """Return the number of clusters of the base cut, which `rule` names directly.

    With letters this is the first of `cuts`, else the paper's three or the number of names.
    Raises BadInput for an unknown rule, or a list of names that is empty, repeats one, or holds a
    reserved one.
    """
    if rule == LETTERS:
        return cuts[0] if len(cuts) else len(CLASSES)
    if isinstance(rule, str):
        if rule != TRIPLET:
            raise BadInput(f"reduction.names is {rule!r}; allowed: 'triplet' or a list of names")
        return len(CLASSES)
    if not rule or len(set(rule)) != len(rule):
        raise BadInput(f"reduction.names is {list(rule)}; a list of names must be different names")
    if taken := sorted(RESERVED & set(rule)):
        raise BadInput(f"reduction.names holds {taken[0]!r}, which names runs outside all classes")
    return len(rule)


def all_names(rule: Rule, n_classes: int) -> list[str]:
    """Return the names that `rule` has for so many classes, in order."""
    if rule == LETTERS:
        return [letters(i) for i in range(n_classes)]
    return list(CLASSES if isinstance(rule, str) else rule)


def letters(i: int) -> str:
    """Return the name of class i (from 0) without one of its own: A, ..., Z, AA, AB, ..."""
    above, last = divmod(i, len(ascii_uppercase))
    return (letters(above - 1) if above else "") + ascii_uppercase[last]


def name_base(centroids: Floats, rule: Rule, sizes: Integers | None = None) -> list[str]:
    """Name the clusters of the base cut by their centroids (k, 3) in (V_theta, V_a, V_Omega).

    ``"letters"``: A is the largest by `sizes` (k,), then B, C, ...; equal ones by V_theta.

    ``"triplet"``: of three clusters, chimera has the largest V_Omega. Of the other two, ordered has
    the smaller V_theta. Of two clusters (only two different points), ordered has the smaller
    V_theta; the other is chimera if its V_Omega is larger, else disordered. A single cluster is
    ordered. A list of names is assigned by increasing V_theta. If there are fewer clusters than
    names, the first names are used.
    """
    by_phase = [int(i) for i in np.argsort(centroids[:, 0], kind="stable")]
    names = [""] * len(centroids)
    if rule == LETTERS:
        counts = np.zeros(len(centroids)) if sizes is None else sizes
        by_size = np.lexsort((centroids[:, 0], -counts))
        for i, cluster in enumerate(by_size.tolist()):
            names[cluster] = letters(i)
        return names
    if not isinstance(rule, str):
        for name, cluster in zip(rule, by_phase, strict=False):
            names[cluster] = name
        return names
    if len(centroids) == 3:
        chimera = int(np.argmax(centroids[:, 2]))
        by_phase.remove(chimera)
        names[chimera] = "chimera"
    for name, cluster in zip(("ordered", "disordered"), by_phase, strict=False):
        names[cluster] = name
    if len(centroids) == 2 and np.argmax(centroids[:, 2]) == by_phase[1]:
        names[by_phase[1]] = "chimera"
    return names


def inherit(base_labels: Integers, base_names: Sequence[str], labels: Integers) -> list[str]:
    """Return the family of each cluster in `labels`: the base class that holds most of its members.

    A finer cluster lies inside one base class. A coarser one is a union of base classes and takes
    the name of the largest, so names stay different.
    """
    both = (labels >= 0) & (base_labels >= 0)
    counts = np.zeros((labels.max() + 1, len(base_names)), dtype=np.int64)
    np.add.at(counts, (labels[both], base_labels[both]), 1)
    return [base_names[family] for family in counts.argmax(axis=1)]


def add_suffixes(families: Sequence[str], centroids: Floats) -> list[str]:
    """Append -1, -2, ... to families of several clusters, by decreasing V_a of the centroid.

    The paper numbers its sub-classes in this order (fig. 14: weakly homogeneous
    before travelling wave, irregular before nearly equal amplitudes).
    """
    names = list(families)
    for family in set(families):
        clusters = [i for i, name in enumerate(families) if name == family]
        if len(clusters) > 1:
            clusters.sort(key=lambda i: (-centroids[i, 1], centroids[i, 0]))
            for number, cluster in enumerate(clusters, start=1):
                names[cluster] = f"{family}-{number}"
    return names
