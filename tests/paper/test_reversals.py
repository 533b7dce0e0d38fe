"""Two more readings of W(Q_r): links drawn with replacement, and the norm of the divergence."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scoreboard.reversals import Norms, links_turned, with_replacement


@pytest.mark.parametrize(("n_links", "draws"), [(3, 4), (4, 3), (2, 0)])
def test_links_turned_is_what_counting_every_sequence_of_draws_gives(
    n_links: int, draws: int
) -> None:
    count = np.zeros(n_links + 1)
    for sequence in product(range(n_links), repeat=draws):
        odd = sum(sequence.count(link) % 2 for link in range(n_links))
        count[odd] += 1
    np.testing.assert_allclose(links_turned(n_links, draws), count / n_links**draws, atol=1e-15)


def test_w_with_replacement_is_the_mean_over_the_number_of_turned_links() -> None:
    x, w = np.arange(3.0), np.array([1.0, 0.5, 0.0])
    # Two draws of two links: both times the same (none turned) or both links, evenly.
    np.testing.assert_allclose(with_replacement(x, w, 2, [0, 1, 2]), [1.0, 0.5, 0.5])


def test_bins_of_the_norm_hold_as_many_runs_each() -> None:
    norms = Norms(np.array([4.0, 1.0, 3.0, 2.0]), np.array([False, True, False, True]))
    band = norms.band(2)
    np.testing.assert_allclose(band.x, [1.5, 3.5])
    np.testing.assert_allclose(band.fraction, [1.0, 0.0])
