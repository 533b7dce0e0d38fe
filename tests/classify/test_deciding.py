"""When votes decide a class, and how often they are wrong."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from chimera_hpc.classify.deciding import clopper_pearson, decisions, expected_runs

SIZES = np.array([30, 20, 10])


def votes(*rows: tuple[int, ...]) -> NDArray[np.int64]:
    """Votes for three classes, steady runs and runs without a window."""
    return np.array([(*row, 0, 0)[:5] for row in rows])


@pytest.mark.parametrize(
    ("row", "lead"),
    [
        ((5, 0, 0), 1 - 2 / 64),  # each rival: P(Beta(6, 1) < 1/2) = 2^-6
        ((0, 4, 1), 1 - 1 / 32 - 7 / 64),  # P(Beta(5, 1) < 1/2), P(Beta(5, 2) < 1/2)
        ((0, 0, 0, 5), 1 - 4 / 64),  # steady runs lead over all classes
    ],
)
def test_lead_is_the_dirichlet_bound(row, lead):
    assert decisions(votes(row), SIZES, 0.95).lead[0] == pytest.approx(lead, rel=1e-12)


def test_bound_is_below_the_probability_that_a_class_leads():
    counts = [12, 4, 2]
    shares = np.random.default_rng(1).dirichlet(np.add(counts, 1), 100_000)
    leads = (shares.argmax(axis=1) == 0).mean()
    bound = decisions(votes(tuple(counts)), SIZES, 0.95).lead[0]
    assert bound <= leads + 0.003
    assert bound == pytest.approx(leads, abs=0.005)  # where it matters


def test_silent_runs_count_only_where_no_run_has_a_class():
    found = decisions(votes((5, 0, 0, 90, 0), (0, 0, 0, 90, 10), (0, 0, 0, 0, 0)), SIZES, 0.95)
    assert found.leader.tolist() == [0, 3, -1]
    assert found.decided.tolist() == [True, True, False]
    np.testing.assert_allclose(found.share, [1.0, 0.9, np.nan])


def test_of_a_single_class_a_second_one_may_not_have_been_seen():
    one = np.array([(1, 0, 0), (5, 0, 0), (5, 90, 0)])
    found = decisions(one, np.array([7]), 0.95)
    np.testing.assert_allclose(found.lead, [3 / 4, 63 / 64, 63 / 64])
    assert found.decided.tolist() == [False, True, True]


def test_a_tie_is_not_decided():
    assert not decisions(votes((50, 50, 0)), SIZES, 0.6).decided[0]


@pytest.mark.parametrize("share", [0.02, 0.5, 0.77, 0.999])
def test_interval_holds_at_least_as_often_as_stated(share):
    hits = np.arange(21)
    low, high = clopper_pearson(hits, np.full(21, 20), 0.95)
    covered = (low <= share) & (share <= high)
    assert binom.pmf(hits, 20, share)[covered].sum() >= 0.95
    assert (low[0], high[20]) == (0.0, 1.0)
    assert low[20] == pytest.approx(0.025 ** (1 / 20))


def in_rounds(shares, confidence=0.95, first=5, batch=5, most=100):
    """Draw votes of cells with these shares, round by round; return the votes."""
    rng = np.random.default_rng(2)
    drawn = rng.multinomial(first, shares)
    for _ in range((most - first) // batch):
        full = np.pad(drawn, ((0, 0), (0, 2)))
        open_ = ~decisions(full, np.ones(3), confidence).decided
        drawn[open_] += rng.multinomial(batch, shares[open_])
    return np.pad(drawn, ((0, 0), (0, 2)))


def test_of_cells_drawn_from_the_prior_at_least_the_stated_share_is_right():
    shares = np.random.default_rng(3).dirichlet(np.ones(3), 4000)
    found = decisions(in_rounds(shares), np.ones(3), 0.95)
    right = found.leader == shares.argmax(axis=1)
    assert right[found.decided].mean() >= 0.95
    assert found.decided.mean() > 0.75


@pytest.mark.parametrize(
    ("share", "most_wrong"), [(0.7, 0.01), (0.6, 0.04), (0.55, 0.1), (0.51, 0.21)]
)
def test_the_nearer_two_classes_the_more_often_twenty_looks_decide_wrongly(share, most_wrong):
    shares = np.tile([share, 1.0 - share, 0.0], (4000, 1))
    found = decisions(in_rounds(shares), np.ones(3), 0.95)
    wrong = found.decided & (found.leader != 0)
    assert most_wrong / 4 <= wrong.mean() <= most_wrong


def test_expectation_is_near_what_cells_then_take():
    start = votes(*[(3, 2, 0)] * 50)
    expected = expected_runs(start, SIZES, 0.95, 5, 100)
    rng = np.random.default_rng(4)
    shares = rng.dirichlet([4, 3, 1], 50)
    taken, drawn = 0, start.copy()
    for _ in range(19):
        open_ = ~decisions(drawn, SIZES, 0.95).decided
        drawn[open_, :3] += rng.multinomial(5, shares[open_])
        taken += 5 * int(open_.sum())
    assert expected == pytest.approx(taken, rel=0.35)
    assert expected_runs(votes((5, 0, 0)), SIZES, 0.95, 5, 100) == 0.0


def test_no_more_runs_are_expected_than_a_cell_may_have():
    # Two votes more cannot decide a tie of seven.
    assert expected_runs(votes((7, 7, 0)), SIZES, 0.95, 5, 16) == 2.0
