"""Where the votes for two classes cross."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.special import log_expit

from chimera_hpc.classify.crossing import crossing

X = np.array([0.0, 40.0, 60.0, 65.0, 70.0, 80.0, 160.0])


def test_votes_of_a_logistic_share_cross_where_it_is_one_half():
    share = 1 / (1 + np.exp(-(X - 68.0) / 9.0))
    at, low, high = crossing(X, 1e6 * (1 - share), 1e6 * share, 0.95)
    assert at == pytest.approx(68.0, abs=0.3)
    assert low <= at <= high
    assert high - low < 1.0


def test_a_step_lies_anywhere_between_its_cells():
    at, low, high = crossing([0, 1, 2, 3], [9, 9, 0, 0], [0, 0, 9, 9], 0.95)
    assert at == pytest.approx(1.5, abs=0.05)
    assert 0.9 < low < 1.2
    assert 1.8 < high < 2.1


def test_interval_holds_about_as_often_as_stated():
    rng = np.random.default_rng(5)
    share = 1 / (1 + np.exp(-(X - 66.0) / 9.0))
    n = np.array([10, 40, 100, 100, 100, 40, 10])
    held = 0
    for _ in range(100):
        above = rng.binomial(n, share)
        _, low, high = crossing(X, n - above, above, 0.95)
        held += low <= 66.0 <= high
    assert held >= 91  # 95 % of 100 less two standard deviations


def test_ends_are_where_twice_the_loss_of_likelihood_is_the_quantile_of_chi_squared():
    share = 1 / (1 + np.exp(-(X - 68.0) / 9.0))
    above = np.round(40 * share)

    def loss(place: float) -> float:
        def of_slope(log_slope: float) -> float:
            z = np.exp(log_slope) * (X - place)
            return -float(above @ log_expit(z) + (40 - above) @ log_expit(-z))

        return float(minimize_scalar(of_slope, bounds=(-6.0, 3.0), method="bounded").fun)

    best = minimize_scalar(loss, bounds=(50.0, 90.0), method="bounded")
    ends = [
        brentq(lambda x: 2 * (loss(x) - best.fun) - 3.841, *sorted((best.x, far)))
        for far in (50.0, 90.0)
    ]
    assert crossing(X, 40 - above, above, 0.95)[1:] == pytest.approx(ends, abs=0.3)
