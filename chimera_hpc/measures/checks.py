"""Input checks that all measures share."""

from __future__ import annotations

import operator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput

Array = NDArray[np.float64]

_SECONDS = {
    "M": ': pass seconds, (t - t[0]) / np.timedelta64(1, "s")',
    "m": ': pass seconds, t / np.timedelta64(1, "s")',
}


def floats(name: str, values: ArrayLike) -> Array:
    """Return values of any shape as float64.

    Raises BadInput: the values are not real numbers (complex, dates, words), some are masked, or
    the rows differ in length.
    """
    parts = values if isinstance(values, list | tuple) else [values]
    if any(np.ma.is_masked(part) for part in parts):
        raise BadInput(f"{name} holds masked values: interpolate them or leave them out")
    kind = ""
    try:
        array = np.asarray(values)
        if array.dtype.kind in "biufO":
            return np.asarray(array, dtype=np.float64)
        kind = f", not {array.dtype}" + _SECONDS.get(array.dtype.kind, "")
    except (TypeError, ValueError):
        pass  # rows of several lengths, or objects that are no numbers
    raise BadInput(f"{name} must be an array of real numbers{kind}")


def node_rows(name: str, values: ArrayLike) -> Array:
    """Return a recording (T, N) as contiguous rows (N, T), one per node.

    An array whose transpose is contiguous is not copied, unless it is read-only. Kernels would be
    compiled again for read-only arrays.

    Raises BadInput: the shape is not (T, N) with T, N >= 1; or as `floats`.
    """
    array = floats(name, values)
    if array.ndim != 2 or array.size == 0:
        raise BadInput(f"{name} must have shape (times, nodes), not {array.shape}")
    rows = np.ascontiguousarray(array.T)
    return rows if rows.flags.writeable else rows.copy()


def integer(name: str, value: int) -> int:
    """Return the value as int. Raises BadInput: the value is not a whole number."""
    try:
        return operator.index(value)
    except TypeError as error:
        raise BadInput(f"{name} must be a whole number, not {value!r}") from error


def choice(name: str, value: str, allowed: tuple[str, ...]) -> None:
    """Raise BadInput unless the value is one of the allowed words."""
    if value not in allowed:
        raise BadInput(f"{name} must be one of {', '.join(allowed)}, not {value!r}")
