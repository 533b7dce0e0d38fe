"""First states from a user's file, ``integrator.initial``: a NumPy file with the arrays u and v."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from hashlib import blake2b
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest

Array = NDArray[np.float64]

_NAMES = {"u": "u", "phase": "u", "v": "v"}
_RULE = "arrays u (or phase) and v are needed"


@dataclass(frozen=True, eq=False)
class InitialFile:
    """First states: u (rows, n_observed) and v (rows, n_second); one row for all, or one per seed.

    Row s is for seed s.
    """

    u: Array
    v: Array

    def state(self, seed: int) -> tuple[Array, Array]:
        """Return u and v of a seed."""
        return self.u[seed if len(self.u) > 1 else 0], self.v[seed if len(self.v) > 1 else 0]

    def check(self, sizes: tuple[int, int], seed: int) -> None:
        """Raise BadInput unless there is a state of these sizes for the seed."""
        for name, values, size in (("u", self.u, sizes[0]), ("v", self.v, sizes[1])):
            if values.shape[1] != size:
                raise BadInput(
                    f"{name} has {values.shape[1]} values per state, this model has {size}"
                )
            if 1 < len(values) <= seed:
                raise BadInput(
                    f"{name} has {len(values)} rows, none for seed {seed}: row s is for seed s"
                )


def read_initial(path: str | Path) -> tuple[InitialFile, str]:
    """Return the states of a file, and the digest of its bytes (16 hexadecimal digits).

    Raises BadInput: it is no such file, or has other arrays than u (or phase) and v, of real finite
    numbers, one-dimensional or with one row per seed.
    """
    try:
        digest = blake2b(Path(path).read_bytes(), digest_size=8).hexdigest()
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}") from None
    except (ValueError, AttributeError, BadZipFile, EOFError):
        raise BadInput(f"{path}: not a NumPy file .npz; {_RULE}") from None
    try:
        return _states(arrays), digest
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None


@lru_cache(maxsize=4)
def initial_file(path: str, digest: str) -> InitialFile:
    """Return the states of a file. Raises BadInput: it has another digest than it had."""
    states, found = read_initial(path)
    if found != digest:
        raise BadInput(f"{path}: the file has changed since the sweep was planned")
    return states


def _states(arrays: Mapping[str, NDArray[Any]]) -> InitialFile:
    found: dict[str, Array] = {}
    for name, values in arrays.items():
        if name not in _NAMES:
            raise BadInput(f"unknown array {name[:60]!r}{nearest(name, list(_NAMES))}; {_RULE}")
        if _NAMES[name] in found:
            raise BadInput("u and phase are two names of the same array")
        found[_NAMES[name]] = _rows(name, values)
    if "u" not in found:
        raise BadInput(f"no array u; {_RULE}")
    return InitialFile(found["u"], found.get("v", np.empty((1, 0))))


def _rows(name: str, values: NDArray[Any]) -> Array:
    if values.dtype.kind not in "iuf" or values.ndim not in (1, 2) or not len(values):
        raise BadInput(
            f"{name} has type {values.dtype} and shape {values.shape}: real numbers of shape "
            "(n,) or (seeds, n) are needed"
        )
    if not np.isfinite(values).all():
        raise BadInput(f"{name} holds values that are not finite")
    return np.atleast_2d(values.astype(np.float64))
