"""Order conditions of every method, tree by tree, and what a tableau refuses."""

from __future__ import annotations

from dataclasses import replace

import naive
import numpy as np
import pytest
from kernel_tools import METHODS

from chimera_hpc.integrate.tsit5 import TSIT5

methods = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


def defects(weights, a, order):
    """How far weights (s,) miss each order condition of exactly this order."""
    trees = naive.rooted_trees(order)
    return np.array(
        [weights @ naive.elementary_weights(tree, a) - 1.0 / naive.density(tree) for tree in trees]
    )


def test_number_of_trees_is_the_known_one():
    assert [len(naive.rooted_trees(order)) for order in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]


@methods
def test_solution_has_its_order_and_no_more(method):
    for order in range(1, method.order + 1):
        assert np.abs(defects(method.b, method.a, order)).max() < 1e-13
    assert np.abs(defects(method.b, method.a, method.order + 1)).max() > 1e-6


@methods
def test_embedded_solution_has_its_order_and_no_more(method):
    for order in range(1, method.error_order + 1):
        assert np.abs(defects(method.b - method.e, method.a, order)).max() < 1e-13
    assert np.abs(defects(method.b - method.e, method.a, method.error_order + 1)).max() > 1e-5
    assert method.error_order == method.order - 1


@methods
def test_interpolant_has_its_order_and_no_more(method):
    def missed(order):
        # condition at every theta: a polynomial whose only term is theta**order / density
        misses = []
        for tree in naive.rooted_trees(order):
            polynomial = naive.elementary_weights(tree, method.a) @ method.p
            polynomial[order - 1] -= 1.0 / naive.density(tree)
            misses.append(np.abs(polynomial).max())
        return max(misses)

    for order in range(1, method.interpolant_order + 1):
        assert missed(order) < 1e-12
    if method.p.shape[1] > method.interpolant_order:
        assert missed(method.interpolant_order + 1) > 1e-5
    assert method.interpolant_order >= method.order - 1


@methods
def test_interpolant_joins_the_next_step_smoothly(method):
    powers = np.arange(1, method.p.shape[1] + 1)
    first, last = np.eye(method.stages)[[0, -1]]
    np.testing.assert_allclose(method.p[:, 0], first, atol=1e-13)
    np.testing.assert_allclose(method.p @ powers, last, atol=1e-12)
    np.testing.assert_allclose(method.p.sum(axis=1), method.b, atol=1e-12)


@methods
def test_last_stage_is_the_first_of_the_next_step(method):
    np.testing.assert_array_equal(method.a[-1], method.b)
    assert method.b[-1] == 0.0
    np.testing.assert_allclose(method.c[-1], 1.0, atol=1e-14)
    assert method.c[0] == 0.0


def test_a_method_has_the_name_that_a_job_asks_for():
    assert all(name == method.name for name, method in METHODS.items())


def changed(array, at, by):
    array = array.copy()
    array[at] += by
    return array


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"a": TSIT5.a[:, :-1]}, "shapes"),
        ({"e": TSIT5.e[:-1]}, "shapes"),
        ({"p": TSIT5.p[:-1]}, "shapes"),
        ({"a": changed(TSIT5.a, (2, 2), 0.1)}, "not explicit"),
        ({"a": changed(TSIT5.a, (2, 4), 0.1)}, "not explicit"),
        ({"a": changed(TSIT5.a, (-1, 0), 1e-12)}, "weights must sum to 1"),
        ({"e": changed(TSIT5.e, 3, 1e-12)}, "error weights to 0"),
        ({"p": changed(TSIT5.p, (3, 2), 1e-10)}, "interpolant does not end"),
    ],
)
def test_contradicting_coefficients_are_refused(wrong, words):
    with pytest.raises(ValueError, match=f"tsit5: .*{words}"):
        replace(TSIT5, **wrong)
