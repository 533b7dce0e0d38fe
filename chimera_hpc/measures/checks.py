"""What all observables ask of a recording."""

from __future__ import annotations

import operator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput

Array = NDArray[np.float64]


def floats(name: str, values: ArrayLike) -> Array:
    """The values as float64, whatever their shape.

    Raises
    ------
    BadInput
        They are not real numbers (complex, dates, words), some are masked, or their rows differ in
        length.
    """
    if np.ma.is_masked(values):
        raise BadInput(f"{name} holds masked values: interpolate them or leave them out")
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "biufO":
            raise BadInput(f"{name} must be an array of real numbers, not {array.dtype}")
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{name} must be an array of real numbers") from error


def node_rows(name: str, values: ArrayLike) -> Array:
    """A recording (T, N) as contiguous rows (N, T), one a node.

    An array whose transpose is contiguous is not copied, unless it is read-only: kernels would be
    compiled once more for read-only arrays.

    Raises
    ------
    BadInput
        The shape is not (T, N) with T, N >= 1, or as `floats`.
    """
    array = floats(name, values)
    if array.ndim != 2 or array.size == 0:
        raise BadInput(f"{name} must have shape (times, nodes), not {array.shape}")
    rows = np.ascontiguousarray(array.T)
    return rows if rows.flags.writeable else rows.copy()


def integer(name: str, value: int) -> int:
    """The value as int.

    Raises
    ------
    BadInput
        It is not a whole number.
    """
    try:
        return operator.index(value)
    except TypeError as error:
        raise BadInput(f"{name} must be a whole number, not {value!r}") from error


def choice(name: str, value: str, allowed: tuple[str, ...]) -> None:
    """Raise BadInput unless the value is one of the allowed words."""
    if value not in allowed:
        raise BadInput(f"{name} must be one of {', '.join(allowed)}, not {value!r}")
