"""Stability of labels and modal classes: runs labelled twice, and seeds resampled."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from chimera_hpc.classify.modes import modal_votes
from chimera_hpc.classify.robustness import wilson_interval
from chimera_hpc.classify.tree import Floats, Integers

DRAWS = 1000
FIRM = 0.9
"""A modal class is firm if at least this share of the resamplings gives it."""


class Change(NamedTuple):
    """Differences between two labellings of the same runs."""

    changed: int
    of: int
    """Number of runs that have a label in both."""
    low: float
    high: float
    """Wilson 95 % interval of the share that changed."""
    total_variation: float
    """0.5 * sum |q - p| over the class fractions p before and q after (total variation)."""
    net: dict[str, float]
    """q - p of each class where it is not 0."""
    moves: dict[str, int]
    """Number of runs by ``"before to after"``."""


def compare_labels(before: Sequence[str], after: Sequence[str | None]) -> Change:
    """Compare two labellings of the same runs. A run without a label after (None) is left out."""
    pairs = [(a, b) for a, b in zip(before, after, strict=True) if b is not None]
    moves = Counter(f"{a} to {b}" for a, b in pairs if a != b)
    low, high = wilson_interval(moves.total(), len(pairs))
    first, second = Counter(a for a, _ in pairs), Counter(b for _, b in pairs)
    net = {
        name: (second[name] - first[name]) / len(pairs)
        for name in sorted({*first, *second})
        if second[name] != first[name]
    }
    return Change(
        changed=moves.total(),
        of=len(pairs),
        low=float(low),
        high=float(high),
        total_variation=0.5 * sum(map(abs, net.values())),
        net=net,
        moves=dict(moves),
    )


def kept_shares(
    votes: Integers, sizes: Integers, rng: np.random.Generator, draws: int = DRAWS
) -> Floats:
    """Return for each cell the share of resamplings of its seeds with the same modal class.

    The n runs of a cell are drawn n times with replacement (the bootstrap, Efron 1979,
    doi:10.1214/aos/1176344552): the votes of a draw are multinomial with probabilities votes / n.

    votes (n_cells, k + 2): runs by class, then steady ones and those without a window, as for
        `modal_votes`.
    sizes (k,): members of each class in the whole sweep, which decide ties.

    Returns (n_cells,): NaN for a cell with fewer than two runs.
    """
    total, modal = votes.sum(axis=1), modal_votes(votes, sizes)
    kept = np.full(len(votes), np.nan)
    for i in np.flatnonzero(total >= 2):
        drawn = rng.multinomial(int(total[i]), votes[i] / total[i], size=draws)
        kept[i] = np.mean(modal_votes(drawn, sizes) == modal[i])
    return kept


def spread_sample(cell: Integers, usable: Integers, size: int, seed: int) -> Integers:
    """Return `size` of the points `usable`, in increasing order, spread evenly over their cells.

    Points are put into the random order of ``numpy.random.default_rng(seed)``. Each cell gives its
    first point, then each gives its second, and so on. A larger sample with the same seed contains
    the smaller one.

    cell (n,): cell of each point of the sweep.
    usable (m,): points to choose from.
    """
    order = np.random.default_rng(seed).permutation(usable)
    by_cell = np.argsort(cell[order], kind="stable")
    grouped = cell[order][by_cell]
    turn = np.empty(len(order), dtype=np.int64)
    turn[by_cell] = np.arange(len(order)) - np.searchsorted(grouped, grouped)
    chosen: Integers = np.sort(order[np.argsort(turn, kind="stable")[:size]])
    return chosen
