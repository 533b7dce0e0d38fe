"""Incoherence and order on signals whose answers can be worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.incoherence import (
    differences,
    discontinuity_measure,
    local_sigma,
    order_parameter,
    range_of,
    sigma,
    strength_of_incoherence,
)

# the published vector: z = (-1, 1, 0, 0) and (0, -3, 4, -1)
X = np.array([[0.0, 1.0, 0.0, 0.0], [2.0, 2.0, 5.0, 1.0]])


def test_differences_close_the_ring():
    assert differences(X).tolist() == [[-1, 1, 0, 0], [0, -3, 4, -1]]


def test_published_vector_of_the_deviations():
    assert sigma(X) == pytest.approx((np.sqrt(2 / 4) + np.sqrt(26 / 4)) / 2, rel=1e-15)
    expected = [(np.sqrt(2 / 2) + np.sqrt(9 / 2)) / 2, (0 + np.sqrt(17 / 2)) / 2]
    np.testing.assert_allclose(local_sigma(X, 2), expected, rtol=1e-15)


@pytest.mark.parametrize(("delta", "si", "eta"), [(1.5, 0.5, 1), (1.6, 0, 0), (1.0, 1, 0)])
def test_published_vector_of_strength_and_discontinuity(delta, si, eta):
    local = local_sigma(X, 2)
    assert strength_of_incoherence(local, delta) == si
    assert discontinuity_measure(local, delta) == eta


def test_groups_that_do_not_divide_equally_are_larger_first():
    # one step of height 1 at node j makes z = -1 at j - 1 and z = 1 at the ring's end
    for j, group in [(9, 0), (10, 1), (18, 1), (19, 2), (26, 2), (27, 3), (42, 4), (43, 5)]:
        x = np.zeros((1, 50))
        x[0, j:] = 1.0
        local = local_sigma(x, 6)
        size = [9, 9, 8, 8, 8, 8]
        expected = np.zeros(6)
        expected[group] += 1 / size[group]
        expected[5] += 1 / 8
        np.testing.assert_allclose(local, np.sqrt(expected), rtol=1e-15)


def test_sigma_is_not_blind_to_time():
    x = np.array([[0.0, 1.0], [0.0, 3.0]])  # z = (-1, 1), (-3, 3): deviations 1 and 3
    assert sigma(x) == 2.0


def test_long_recordings_are_the_mean_of_their_parts():
    x = np.random.default_rng(0).normal(size=(2500, 5))
    parts = np.array([local_sigma(part, 2) for part in np.array_split(x, 5)])
    np.testing.assert_allclose(local_sigma(x, 2), parts.mean(axis=0), rtol=1e-13)


def test_a_coherent_ring_has_no_deviation():
    x = np.repeat(np.sin(np.arange(300.0))[:, None], 7, axis=1)
    assert sigma(x) == 0.0
    assert strength_of_incoherence(local_sigma(x, 3), 0.0) == 0.0


def test_a_deviation_equal_to_delta_is_coherent():
    assert strength_of_incoherence([0.25, 0.5], 0.25) == 0.5
    assert strength_of_incoherence([0.25, 0.5], np.nextafter(0.25, 0)) == 1.0


@pytest.mark.parametrize(
    ("coherent", "si", "eta"),
    [
        ([1, 1, 1, 1, 1, 1], 0, 0),
        ([0, 0, 0, 0, 0, 0], 1, 0),
        ([1, 1, 0, 0, 1, 1], 1 / 3, 1),  # a chimera
        ([0, 1, 1, 1, 1, 0], 1 / 3, 1),  # the same, over the ring's end
        ([1, 0, 1, 0, 1, 1], 1 / 3, 2),  # a multi-chimera
        ([1, 0, 1, 0, 1, 0], 1 / 2, 3),
        ([0], 1, 0),
    ],
)
def test_stretches_by_hand(coherent, si, eta):
    local = np.where(coherent, 0.1, 2.0)
    assert strength_of_incoherence(local, 1.0) == pytest.approx(si, abs=1e-15)
    assert discontinuity_measure(local, 1.0) == eta


def test_many_runs_and_thresholds_at_once():
    local = np.array([[0.1, 0.3], [0.2, 0.2], [np.nan, 0.1]])
    delta = np.array([0.2, 0.1, 0.1])
    np.testing.assert_array_equal(strength_of_incoherence(local, delta), [0.5, 1.0, np.nan])
    np.testing.assert_array_equal(discontinuity_measure(local, delta), [1.0, 0.0, np.nan])
    curve = strength_of_incoherence([0.1, 0.3], np.array([0.0, 0.1, 0.3]))
    assert curve.tolist() == [1.0, 0.5, 0.0]


def test_one_run_gives_a_float():
    assert type(strength_of_incoherence([0.1], 0.2)) is float
    assert type(discontinuity_measure([0.1], 0.2)) is float


def test_range_is_over_times_and_nodes():
    assert range_of([[0.0, -2.0], [5.0, 1.0]]) == 7.0


def circle(phases, n_times=200):
    angle = 2 * np.pi * np.arange(n_times)[:, None] / n_times + np.asarray(phases)
    return 3.0 + 2.0 * np.cos(angle), -1.0 + 2.0 * np.sin(angle)


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        ([0.4, 0.4, 0.4], 1.0),
        ([0.0, np.pi], 0.0),
        ([0.0, np.pi / 2], np.sqrt(0.5)),
        ([0.0, 2 * np.pi / 3, -2 * np.pi / 3], 0.0),
        ([0.0, 0.0, 0.0, np.pi], 0.5),
    ],
)
def test_order_parameter_by_hand(phases, expected):
    assert order_parameter(*circle(phases)) == pytest.approx(expected, abs=1e-12)


@given(st.floats(0.1, 10), st.floats(-5, 5))
def test_order_parameter_ignores_size_and_place_of_the_orbits(size, place):
    u, w = circle([0.0, 1.0, 2.5])
    moved = order_parameter(size * u + place, size * w - place)
    assert moved == pytest.approx(order_parameter(u, w), abs=1e-9)


def test_order_parameter_of_nodes_at_rest_is_one():
    assert order_parameter(np.ones((5, 3)), np.zeros((5, 3))) == 1.0


def test_layout_changes_no_bit():
    x = np.random.default_rng(0).normal(size=(40, 6))
    y = np.asfortranarray(x)
    y.setflags(write=False)
    assert np.array_equal(local_sigma(x, 4), local_sigma(y, 4))
    assert order_parameter(x, x + 1) == order_parameter(y, y + 1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: local_sigma(X, 0), r"groups must be in 1 \.\. 4"),
        (lambda: local_sigma(X, 5), r"groups must be in 1 \.\. 4 \(the nodes\), not 5"),
        (lambda: local_sigma(X, 1.5), "groups must be a whole number"),
        (lambda: sigma(X[0]), r"x must have shape \(times, nodes\), not \(4,\)"),
        (lambda: sigma(np.empty((0, 3))), "x must have shape"),
        (lambda: sigma([[np.nan, 0.0]]), "x and its squares must be finite"),
        (lambda: range_of([[np.inf, 0.0]]), "x must be finite"),
        (lambda: sigma([["a", "b"]]), "x must be an array of real numbers"),
        (lambda: order_parameter(X, X[:, :2]), r"one shape, not \(2, 4\) and \(2, 2\)"),
        (lambda: order_parameter(X, X * np.nan), "w must be finite"),
        (lambda: strength_of_incoherence([0.1], -0.1), "delta must be >= 0, not -0.1"),
        (lambda: strength_of_incoherence([0.1], np.nan), "delta must be >= 0"),
        (lambda: strength_of_incoherence([], 0.1), r"local must have shape \(\.\.\., groups\)"),
        (lambda: discontinuity_measure(0.5, 0.1), "local must have shape"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(BadInput, match=message):
        call()
