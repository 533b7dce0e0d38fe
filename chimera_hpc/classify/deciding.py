r"""When the votes of the runs of a cell decide its modal class, and how often they are wrong.

The shares p of the classes among the runs of a cell have a uniform prior. With n_j votes for class
j their posterior is Dirichlet(n_1 + 1, ..., n_k + 1), and the probability that class m leads is

    P(p_m > p_j for all j) >= 1 - sum_{j != m} I_{1/2}(n_m + 1, n_j + 1),

I the regularised incomplete beta function: p_m / (p_m + p_j) is Beta(n_m + 1, n_j + 1). The lead is
this bound; for two classes it is exact. Five equal votes of three classes have a lead of 0.969.
Where only one class is known, a second one counts that no run has shown: no vote decides alone.

As in the modal class, runs that do not oscillate have a vote only where none does; the lead is then
one over all classes, since a run that oscillates would alter the modal class.

Votes are looked at after each batch. A lead is a posterior probability, which does not depend on
when one stops: of cells whose shares come from the prior, at least the stated part is decided
right. It is no bound for every single share: the nearer the two leading shares, the more often one
of many looks decides by chance.

The interval of a share is that of Clopper and Pearson 1934, doi:10.1093/biomet/26.4.404. With a
number of runs that was fixed before, it holds for any share at least as often as stated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, betaincinv

from chimera_hpc.classify.modes import modal_votes
from chimera_hpc.classify.tree import Floats, Integers

SILENT = 2
"""Columns of votes behind those of the classes: steady runs, and runs without a window."""


@dataclass(frozen=True)
class Decisions:
    """What the votes say of each cell; arrays (n_cells,)."""

    leader: Integers
    """Column of the modal class, -1 without a vote."""
    lead: Floats
    """Posterior probability, at least, that it leads all others; 0 without a vote."""
    decided: NDArray[np.bool_]
    share: Floats
    """Share of the modal class among the runs that have a vote in it; NaN without a vote."""
    low: Floats
    high: Floats
    """Clopper-Pearson interval of the share."""


def decisions(votes: Integers, sizes: Integers, confidence: float) -> Decisions:
    """Judge cells by their votes (n_cells, k + 2).

    sizes: (k,) members of the classes, which settle ties as in `modal_votes`.
    confidence: a cell is decided when its lead exceeds this. It is that of the interval, too.
    """
    counted = voting(votes)
    leader = modal_votes(votes, sizes)
    mine = np.take_along_axis(counted, np.maximum(leader, 0)[:, None], axis=1)[:, 0]
    total = counted.sum(axis=1)
    lead = leads(votes, leader)
    share = np.where(total > 0, mine / np.maximum(total, 1), np.nan)
    low, high = clopper_pearson(mine, total, confidence)
    return Decisions(leader, lead, lead > confidence, share, low, high)


def voting(votes: Integers) -> Integers:
    """Return the votes that count: those of silent runs only where no run has a class."""
    counted = votes.copy()
    counted[votes[:, :-SILENT].any(axis=1), -SILENT:] = 0
    return counted


def leads(votes: Integers, leader: Integers) -> Floats:
    """Return for each cell the posterior probability, at least, that `leader` leads."""
    rivals = np.ones(votes.shape, dtype=np.bool_)
    rivals[votes[:, :-SILENT].any(axis=1), -SILENT:] = False
    np.put_along_axis(rivals, np.maximum(leader, 0)[:, None], False, axis=1)
    a = voting(votes) + 1.0
    mine = np.take_along_axis(a, np.maximum(leader, 0)[:, None], axis=1)
    behind = np.where(rivals, betainc(mine, a, 0.5), 0.0).sum(axis=1)
    behind += np.where(rivals.any(axis=1), 0.0, betainc(mine[:, 0], 1.0, 0.5))
    return np.where(leader >= 0, np.maximum(0.0, 1.0 - behind), 0.0)


def clopper_pearson(hits: Integers, trials: Integers, confidence: float) -> tuple[Floats, Floats]:
    """Return the ends of the interval of a share; 0 and 1 without a trial."""
    tail = (1.0 - confidence) / 2.0
    missed = trials - hits
    low = betaincinv(np.maximum(hits, 1), missed + 1.0, tail)
    high = betaincinv(hits + 1.0, np.maximum(missed, 1), 1.0 - tail)
    return np.where(hits > 0, low, 0.0), np.where(missed > 0, high, 1.0)


def expected_runs(
    votes: Integers, sizes: Integers, confidence: float, batch: int, most: int, draws: int = 20
) -> float:
    """Return the mean number of further runs until all cells are decided or have `most` runs.

    The votes to come are drawn from the posterior predictive distribution of those that are there,
    Dirichlet-multinomial; the generator has a fixed seed.
    """
    rng = np.random.default_rng(0)
    total = 0
    for _ in range(draws):
        drawn = votes.copy()
        shares = rng.gamma(voting(votes) + 1.0)
        shares[votes.sum(axis=1) == 0] = 0.0
        shares[votes[:, :-SILENT].any(axis=1), -SILENT:] *= 0.0
        shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-300)
        while (more := _open(drawn, sizes, confidence, most)).any():
            n = np.minimum(batch, most - drawn.sum(axis=1))[more]
            drawn[more] += rng.multinomial(n, shares[more])
            total += int(n.sum())
    return total / draws


def _open(votes: Integers, sizes: Integers, confidence: float, most: int) -> NDArray[np.bool_]:
    n = votes.sum(axis=1)
    open_: NDArray[np.bool_] = (n > 0) & (n < most)
    open_[open_] = ~decisions(votes[open_], sizes, confidence).decided
    return open_
