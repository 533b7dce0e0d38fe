"""Bootstrap of seeds, two labellings compared, and the sample, against SciPy and by hand."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from chimera_hpc.classify.resampling import compare_labels, kept_shares, spread_sample


def kept(votes: list[list[int]], sizes: list[int], draws: int = 20_000) -> np.ndarray:
    rng = np.random.default_rng(1)
    return kept_shares(np.array(votes), np.array(sizes), rng, draws)


@pytest.mark.parametrize(("first", "n"), [(11, 20), (7, 10), (14, 25), (2, 3)])
def test_share_of_two_classes_is_the_tail_of_the_binomial(first: int, n: int) -> None:
    # The first class stays with more than half of the votes, and with half where it is the larger.
    law = stats.binom(n, first / n)
    exact = {0: law.sf(n // 2), 9: law.sf((n + 1) // 2 - 1)}
    for size, expected in exact.items():
        found = kept([[first, n - first, 0, 0]], [size, 5])[0]
        assert found == pytest.approx(expected, abs=0.012)


def test_share_of_three_classes_is_the_sum_over_the_multinomial() -> None:
    votes, n = np.array([4, 3, 2]), 9
    law = stats.multinomial(n, votes / n)
    draws = [(a, b, n - a - b) for a in range(n + 1) for b in range(n + 1 - a)]
    # Ties go to the first class: it has most members.
    exact = sum(law.pmf(draw) for draw in draws if draw[0] == max(draw))
    assert kept([[4, 3, 2, 0, 0]], [9, 5, 2])[0] == pytest.approx(exact, abs=0.012)


def test_steady_runs_decide_only_where_no_run_has_a_class() -> None:
    found = kept([[1, 0, 9, 0], [0, 0, 6, 1], [0, 0, 0, 0], [3, 0, 0, 0]], [5, 5])
    # The one classified run is drawn at least once in ten.
    assert found[0] == pytest.approx(1.0 - 0.9**10, abs=0.012)
    # Steady as long as most of the seven drawn runs are.
    assert found[1] == pytest.approx(stats.binom.sf(3, 7, 6 / 7), abs=0.012)
    assert found[3] == 1.0
    assert np.isnan(found[2])


def test_a_single_run_has_no_bootstrap() -> None:
    assert np.isnan(kept([[1, 0, 0, 0]], [1, 1])[0])
    assert kept([[2, 0, 0, 0]], [2, 1])[0] == 1.0


def test_labels_are_compared_where_both_are_known() -> None:
    before = ["ordered", "chimera", "chimera", "steady", "ordered"]
    found = compare_labels(before, ["ordered", "ordered", "chimera", "chimera", None])
    assert (found.changed, found.of) == (2, 4)
    assert found.moves == {"chimera to ordered": 1, "steady to chimera": 1}
    assert found.net == {"ordered": 0.25, "steady": -0.25}
    assert found.total_variation == 0.25
    wilson = stats.binomtest(2, 4).proportion_ci(method="wilson")
    assert (found.low, found.high) == pytest.approx((wilson.low, wilson.high), rel=1e-12)


def test_moves_that_cancel_change_labels_and_no_fraction() -> None:
    found = compare_labels(["ordered", "chimera"], ["chimera", "ordered"])
    assert (found.changed, found.total_variation, found.net) == (2, 0.0, {})


def test_nothing_to_compare_is_no_error() -> None:
    found = compare_labels(["ordered"], [None])
    assert (found.changed, found.of, found.low, found.high) == (0, 0, 0.0, 1.0)


def test_the_sample_is_spread_evenly_and_grows_with_its_size() -> None:
    cell = np.repeat(np.arange(6), [1, 4, 4, 4, 4, 4])
    usable = np.flatnonzero(np.arange(21) != 9)
    samples = [spread_sample(cell, usable, size, seed=3) for size in range(1, 21)]
    for size, chosen in enumerate(samples, start=1):
        assert len(set(chosen)) == size
        assert np.all(np.diff(chosen) > 0)
        assert set(chosen) <= set(usable)
        counts = np.bincount(cell[chosen], minlength=6)
        room = np.bincount(cell[usable], minlength=6)
        # No cell gives another point before each other one that has some left has given as many.
        assert np.all((counts >= counts.max() - 1) | (counts == room))
    for smaller, larger in pairwise(samples):
        assert set(smaller) < set(larger)
    assert not np.array_equal(samples[5], spread_sample(cell, usable, 6, seed=4))
