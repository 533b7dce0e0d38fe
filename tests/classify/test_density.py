from __future__ import annotations

import naive
import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.density import bandwidth_by_rule, density_classes, stable_bandwidths


@pytest.fixture
def trimodal() -> np.ndarray:
    rng = np.random.default_rng(0)
    parts = [rng.normal(m, 0.08, n) for m, n in ((0.3, 200), (1.35, 60), (2.0, 180))]
    return np.concatenate(parts)


def test_three_bumps_give_three_named_classes(trimodal: np.ndarray) -> None:
    found = density_classes(trimodal, bandwidth=0.1)
    assert found.names == ("ordered", "chimera", "disordered")
    np.testing.assert_allclose(found.modes, [0.3, 1.35, 2.0], atol=0.03)
    expected = np.repeat([0, 1, 2], [200, 60, 180])
    np.testing.assert_array_equal(found.labels, expected)


def test_bandwidth_is_silvermans_unless_given(trimodal: np.ndarray) -> None:
    assert density_classes(trimodal).bandwidth == bandwidth_by_rule(trimodal)
    assert density_classes(trimodal, bandwidth=0.07).bandwidth == 0.07


def test_stable_bandwidths_are_the_ends_of_a_number_of_modes(trimodal: np.ndarray) -> None:
    low, high = stable_bandwidths(trimodal, 3)
    assert low < 0.1 < high
    for bandwidth, modes in ((0.99 * low, 4), (1.01 * low, 3), (0.99 * high, 3), (1.01 * high, 2)):
        assert len(density_classes(trimodal, bandwidth).modes) == modes


def test_two_points_part_at_the_known_bandwidth() -> None:
    # Two equal Gaussians are bimodal when they are more than two standard deviations apart.
    low, high = stable_bandwidths([0.0, 1.0], 2)
    assert low == 0.0
    assert high == pytest.approx(0.5, rel=5e-3)
    assert stable_bandwidths([0.0, 1.0], 1) == (high, np.inf)


def test_cuts_lie_at_minima_between_modes(trimodal: np.ndarray) -> None:
    found = density_classes(trimodal, bandwidth=0.1)
    assert (found.modes[:-1] < found.cuts).all()
    assert (found.cuts < found.modes[1:]).all()
    for cut in found.cuts:
        i = int(np.searchsorted(found.grid, cut))
        assert found.density[i] < found.density[i - 20]
        assert found.density[i] < found.density[i + 20]


def test_density_equals_the_naive_twin_and_integrates_to_one(trimodal: np.ndarray) -> None:
    found = density_classes(trimodal, bandwidth=0.1)
    twin = naive.kernel_density(trimodal, 0.1, found.grid)
    np.testing.assert_allclose(found.density, twin, rtol=1e-6, atol=1e-9)
    assert np.trapezoid(found.density, found.grid) == pytest.approx(1.0, abs=3e-3)


def test_bandwidth_by_hand() -> None:
    # s = 1.5811, IQR = 2 (1 to 3), IQR / 1.34 = 1.4925 is the smaller.
    values = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    assert bandwidth_by_rule(values) == pytest.approx(0.9 * 2.0 / 1.34 * 5**-0.2)
    # No spread in the middle half: the standard deviation serves.
    values = np.array([0.0, 1.0, 1.0, 1.0, 2.0])
    assert bandwidth_by_rule(values) == pytest.approx(0.9 * np.sqrt(0.5) * 5**-0.2)


def test_one_bump_is_one_class() -> None:
    found = density_classes(np.random.default_rng(1).normal(1.0, 0.1, 200), bandwidth=0.1)
    assert found.names == ("class-1",)
    assert len(found.cuts) == 0
    assert (found.labels == 0).all()


def test_equal_values_are_one_class() -> None:
    found = density_classes([0.5, 0.5, 0.5])
    assert found.labels.tolist() == [0, 0, 0]


def test_values_that_are_not_finite_have_no_class(trimodal: np.ndarray) -> None:
    trimodal[[3, 250]] = np.nan, np.inf
    labels = density_classes(trimodal, bandwidth=0.1).labels
    np.testing.assert_array_equal(np.flatnonzero(labels < 0), [3, 250])


def test_order_of_values_does_not_change_their_classes(trimodal: np.ndarray) -> None:
    order = np.random.default_rng(2).permutation(len(trimodal))
    plain, shuffled = density_classes(trimodal), density_classes(trimodal[order])
    np.testing.assert_array_equal(plain.labels[order], shuffled.labels)


@pytest.mark.parametrize(
    ("values", "bandwidth", "message"),
    [
        ([1.0], None, "two finite"),
        ([np.nan, 1.0], None, "two finite"),
        ([1.0, 2.0], 0.0, "above 0"),
    ],
)
def test_bad_input_is_named(values: list[float], bandwidth: float | None, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        density_classes(values, bandwidth)
