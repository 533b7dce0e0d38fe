"""Axes of a grid: how a job file writes an axis, and which values it means.

====================================  ==============================================================
written                               meaning
====================================  ==============================================================
``7``                                 one value
``[3, 5, 9]``                         these values, in this order
``"2:24"``, ``"0.1:0.9:0.2"``         range ``a:b`` or ``a:b:step``, both ends included
``{ linspace = [0.01, 0.1, 19] }``    19 equally spaced values from 0.01 to 0.1
``"P"``                               equal to the axis (or fixed parameter) P
``"0:P"``, ``"0:P:2"``                range that depends on P, both ends included
====================================  ==============================================================

Ranges and linspace are computed exactly, as fractions of the written decimals, then rounded once:
``"0:1:0.1"`` holds 0.3, not 0.30000000000000004, and equals the list ``[0, 0.1, 0.2, ...]``.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.models.parameters import Parameter

MAX_FLOATS = 10**6
"""Most values of one axis of fractions. Integer ranges are never listed and need no bound."""

_NAME = re.compile(r"[A-Za-z_]\w{0,63}", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d{1,18}", re.ASCII)
_DECIMAL = re.compile(r"[+-]?(\d{1,18}(\.\d{0,18})?|\.\d{1,18})([eE][+-]?\d{1,3})?", re.ASCII)
_SYNTAX = 'a value, a list, "a:b", "a:b:step", "P", "0:P" or { linspace = [a, b, n] }'


@dataclass(frozen=True)
class Values:
    """An independent axis: the values in order, integers or floats."""

    values: range | tuple[float, ...]


@dataclass(frozen=True)
class Same:
    """An axis that equals another one."""

    name: str


@dataclass(frozen=True)
class Between:
    """A range of integers whose ends are integers or names of other axes; both ends included."""

    low: int | str
    high: int | str
    step: int = 1

    def __str__(self) -> str:
        return f"{self.low}:{self.high}" + (f":{self.step}" if self.step != 1 else "")


Axis = Values | Same | Between


def parse_axis(raw: Any, parameter: Parameter) -> Axis:
    """Return the axis that a job file means by `raw`.

    Raises BadInput (without the name of the axis) for a form that is not in the table above, an
    empty axis, a repeated value, and a value that `parameter` does not allow.
    """
    if isinstance(raw, str):
        axis = _from_text(raw, parameter)
    elif isinstance(raw, dict):
        axis = _from_linspace(raw, parameter)
    elif isinstance(raw, list | tuple):
        axis = Values(tuple(parameter.check(value) for value in raw))
    else:
        axis = Values((parameter.check(raw),))
    if isinstance(axis, Values):
        _check_values(axis.values, parameter)
    return axis


def resolve(axis: Axis, fixed: Mapping[str, int | float], parameter: Parameter) -> Axis:
    """Return the axis with every name of a fixed parameter replaced by its value.

    Raises BadInput if the end of a range becomes a fraction, or if the axis becomes empty.
    """
    if isinstance(axis, Same) and axis.name in fixed:
        return Values((parameter.check(fixed[axis.name]),))
    if isinstance(axis, Between):
        axis = Between(_end(axis.low, fixed), _end(axis.high, fixed), axis.step)
        if isinstance(axis.low, int) and isinstance(axis.high, int):
            values = range(axis.low, axis.high + 1, axis.step)
            _check_values(values, parameter)
            return Values(values)
    return axis


def references(axis: Axis) -> tuple[str, ...]:
    """Return the names that the axis depends on."""
    if isinstance(axis, Same):
        return (axis.name,)
    if isinstance(axis, Between):
        return tuple(end for end in (axis.low, axis.high) if isinstance(end, str))
    return ()


def normal_form(axis: Axis) -> str | list[int] | list[float]:
    """Return the normal form of the axis, which is the same for equal axes.

    Three or more integers in equal increasing steps become ``a:b`` or ``a:b:step``. Other values
    become a list. A dependent axis becomes its text without blanks.
    """
    if not isinstance(axis, Values):
        return str(axis) if isinstance(axis, Between) else axis.name
    values = axis.values
    if not isinstance(values[0], int) or len(values) < 3:
        return [value + 0 for value in values]  # + 0 turns -0.0 into 0.0
    step = int(values[1] - values[0])
    if step > 0 and (isinstance(values, range) or _has_step(values, step)):
        return str(Between(int(values[0]), int(values[-1]), step))
    return list(values)


def _has_step(values: tuple[float, ...], step: int) -> bool:
    return all(b - a == step for a, b in pairwise(values))


def _end(end: int | str, fixed: Mapping[str, int | float]) -> int | str:
    if isinstance(end, int) or end not in fixed:
        return end
    value = fixed[end]
    if not isinstance(value, int):
        raise BadInput(f"{end} is not an integer, and the ends of a dependent range must be")
    return value


def _from_text(text: str, parameter: Parameter) -> Axis:
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 1 and _NAME.fullmatch(parts[0]):
        return Same(parts[0])
    if len(parts) not in (2, 3):
        raise BadInput(f"{short(text)} is not {_SYNTAX}")
    low, high, step = (*parts, "1")[:3]
    if parameter.kind is int:
        return _integer_range(_integer_or_name(low), _integer_or_name(high), _integer(step))
    return Values(_floats(_fraction(low), _fraction(high), _fraction(step)))


def _integer_range(low: int | str, high: int | str, step: int) -> Axis:
    if step < 1:
        raise BadInput(f"the step {step} must be above 0")
    if isinstance(low, int) and isinstance(high, int):
        return Values(range(low, high + 1, step))
    return Between(low, high, step)


def _integer_or_name(text: str) -> int | str:
    return text if _NAME.fullmatch(text) else _integer(text)


def _integer(text: str) -> int:
    if not _INTEGER.fullmatch(text):
        raise BadInput(f"{short(text)} is not an integer")
    return int(text)


def _fraction(text: str) -> Fraction:
    if not _DECIMAL.fullmatch(text) or math.isinf(float(text)):
        raise BadInput(f"{short(text)} is not a finite number")
    return Fraction(text)


def _floats(low: Fraction, high: Fraction, step: Fraction) -> tuple[float, ...]:
    """Return low, low + step, ... up to high, each the double nearest to the exact number."""
    if step <= 0:
        raise BadInput("the step must be above 0")
    count = (high - low) // step + 1
    if count > MAX_FLOATS:
        raise BadInput(f"{short(count)} values are too many, at most {MAX_FLOATS} are allowed")
    scale = math.lcm(low.denominator, step.denominator)
    first, increment = int(low * scale), int(step * scale)
    # Python rounds the division of two integers once, to nearest.
    return tuple((first + i * increment) / scale for i in range(count))


def _from_linspace(raw: dict[str, Any], parameter: Parameter) -> Axis:
    bounds = raw.get("linspace")
    if set(raw) != {"linspace"} or not isinstance(bounds, list | tuple) or len(bounds) != 3:
        raise BadInput(f"{short(raw)} is not {_SYNTAX}")
    if parameter.kind is int:
        raise BadInput("linspace makes fractions; write integers as a:b:step")
    low, high = (Fraction(repr(parameter.check(bound))) for bound in bounds[:2])
    count = bounds[2]
    if type(count) is not int or count < 2 or low == high:
        raise BadInput("linspace needs two different ends and a number of values of at least 2")
    if low > high:
        return Values(_floats(high, low, (low - high) / (count - 1))[::-1])
    return Values(_floats(low, high, (high - low) / (count - 1)))


def _check_values(values: range | tuple[float, ...], parameter: Parameter) -> None:
    if len(values) == 0:
        raise BadInput("empty axis, at least one value is needed")
    if isinstance(values, range):
        parameter.check(values[0])
        parameter.check(values[-1])
        return
    for value in values:
        parameter.check(value)
    if len(set(values)) < len(values):
        twice = Counter(values).most_common(1)[0][0]
        raise BadInput(f"{short(twice)} is there twice, and would make duplicate points")
