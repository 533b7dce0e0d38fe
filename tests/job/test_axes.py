"""Axes: what each way of writing means, and its normal form."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.axes import Between, Same, Values, normal_form, parse_axis, resolve
from chimera_hpc.models.parameters import Parameter

INTEGER = Parameter("k", int, None, "", low=-(10**9), high=10**9)
NUMBER = Parameter("x", float, None, "")


@pytest.mark.parametrize(
    ("raw", "values"),
    [
        (7, [7]),
        ([3, 9, 5], [3, 9, 5]),
        ("2:5", [2, 3, 4, 5]),
        ("0:10:5", [0, 5, 10]),
        ("0:11:5", [0, 5, 10]),
        (" -1 : 1 ", [-1, 0, 1]),
        ("4:4", [4]),
    ],
)
def test_integer_axes(raw, values):
    axis = parse_axis(raw, INTEGER)
    assert list(axis.values) == values
    assert all(type(value) is int for value in axis.values)


@pytest.mark.parametrize(
    ("raw", "values"),
    [
        (1, [1.0]),
        (0.5, [0.5]),
        ([1, 0.5], [1.0, 0.5]),
        ("0:1:0.1", [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]),
        ("1e-2:.03:1e-2", [0.01, 0.02, 0.03]),
        ("1:3", [1.0, 2.0, 3.0]),
        ({"linspace": [0.01, 0.1, 4]}, [0.01, 0.04, 0.07, 0.1]),
        ({"linspace": [1, 0, 3]}, [1.0, 0.5, 0.0]),
    ],
)
def test_axes_of_numbers_hold_the_decimals_as_a_person_writes_them(raw, values):
    axis = parse_axis(raw, NUMBER)
    assert list(axis.values) == values
    assert all(type(value) is float for value in axis.values)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.integers(2, 50))
def test_linspace_is_the_nearest_double_to_each_exact_value(a, b, n):
    exact = [
        Fraction(repr(a)) + (Fraction(repr(b)) - Fraction(repr(a))) * i / (n - 1) for i in range(n)
    ]
    values = [float(value) for value in exact]
    if len(set(values)) < n:
        with pytest.raises(BadInput):
            parse_axis({"linspace": [a, b, n]}, NUMBER)
    else:
        assert list(parse_axis({"linspace": [a, b, n]}, NUMBER).values) == values
        np.testing.assert_allclose(values, np.linspace(a, b, n), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("raw", "axis"),
    [
        ("P", Same("P")),
        ("0:P", Between(0, "P")),
        (" 0 : P : 2 ", Between(0, "P", 2)),
        ("Q:P", Between("Q", "P")),
    ],
)
def test_dependent_axes(raw, axis):
    assert parse_axis(raw, INTEGER) == axis


def test_fixed_names_are_resolved():
    assert list(resolve(Between(2, "P", 3), {"P": 9}, INTEGER).values) == [2, 5, 8]
    assert resolve(Same("P"), {"P": 9}, NUMBER) == Values((9.0,))
    assert resolve(Same("Q"), {"P": 9}, INTEGER) == Same("Q")


@pytest.mark.parametrize(
    ("raw", "parameter", "message"),
    [
        ([], INTEGER, "empty axis"),
        ("5:4", INTEGER, "empty axis"),
        ("1:0:0.1", NUMBER, "empty axis"),
        ([3, 4, 3], INTEGER, "3 is there twice"),
        ([0.0, -0.0], NUMBER, "is there twice"),
        (1.0, INTEGER, "1.0 is not an integer"),
        (True, INTEGER, "True is not an integer"),
        ([1, "2"], INTEGER, "'2' is not an integer"),
        ([[1]], INTEGER, "[1] is not an integer"),
        (None, NUMBER, "None is not a finite number"),
        (float("nan"), NUMBER, "nan is not a finite number"),
        ([1.0, float("inf")], NUMBER, "inf is not a finite number"),
        (10**400, NUMBER, "a huge integer is not a finite number"),
        ("1:2:3:4", INTEGER, "'1:2:3:4' is not a value, a list"),
        ("", INTEGER, "'' is not a value, a list"),
        ("5", INTEGER, "'5' is not a value, a list"),
        (":5", INTEGER, "'' is not an integer"),
        ("1.5:3", INTEGER, "'1.5' is not an integer"),
        ("1:3:0", INTEGER, "step 0 must be above 0"),
        ("1:3:P", INTEGER, "'P' is not an integer"),
        ("0:P + 1", INTEGER, "'P + 1' is not an integer"),
        ("1:3:-1", NUMBER, "step must be above 0"),
        ("0:P", NUMBER, "'P' is not a finite number"),
        ("0:1e999", NUMBER, "'1e999' is not a finite number"),
        ("0:1:1e-9", NUMBER, "1000000001 values are too many"),
        ({"linspace": [0, 1]}, NUMBER, "is not a value, a list"),
        ({"linspace": [0, 1, 3], "x": 1}, NUMBER, "is not a value, a list"),
        ({"linspace": [0, 1, 1]}, NUMBER, "at least 2"),
        ({"linspace": [0, 1, 2.0]}, NUMBER, "at least 2"),
        ({"linspace": [1, 1, 3]}, NUMBER, "two different ends"),
        ({"linspace": [0, 8, 3]}, INTEGER, "write integers as a:b:step"),
    ],
)
def test_wrong_axes_are_bad_input(raw, parameter, message):
    with pytest.raises(BadInput) as caught:
        parse_axis(raw, parameter)
    assert message in str(caught.value)


def test_a_fraction_cannot_end_a_dependent_range():
    with pytest.raises(BadInput, match="epsilon is not an integer"):
        resolve(Between(0, "epsilon"), {"epsilon": 0.5}, INTEGER)


def test_a_range_that_a_fixed_value_empties_is_bad_input():
    with pytest.raises(BadInput, match="empty axis"):
        resolve(Between(5, "P"), {"P": 3}, INTEGER)


@pytest.mark.parametrize(
    ("raw", "parameter", "normal"),
    [
        ([2, 3, 4], INTEGER, "2:4"),
        ("2:5:1", INTEGER, "2:5"),
        ("0:11:5", INTEGER, "0:10:5"),
        ([0, 5, 10], INTEGER, "0:10:5"),
        ([4, 3, 2], INTEGER, [4, 3, 2]),
        ([1, 2, 4], INTEGER, [1, 2, 4]),
        ("1:2", INTEGER, [1, 2]),
        (7, INTEGER, [7]),
        (" 0 : P : 1", INTEGER, "0:P"),
        ("0:P:2", INTEGER, "0:P:2"),
        (" P ", INTEGER, "P"),
        ("0:0.3:0.1", NUMBER, [0.0, 0.1, 0.2, 0.3]),
        (1, NUMBER, [1.0]),
    ],
)
def test_normal_forms(raw, parameter, normal):
    assert normal_form(parse_axis(raw, parameter)) == normal


@given(st.lists(st.integers(-20, 20), min_size=1, unique=True))
def test_the_normal_form_means_the_same_values(values):
    again = parse_axis(normal_form(parse_axis(values, INTEGER)), INTEGER)
    assert list(again.values) == values


def test_the_normal_form_has_no_negative_zero():
    assert str(normal_form(parse_axis([-0.0], NUMBER))) == "[0.0]"
