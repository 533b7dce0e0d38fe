"""Names that changed in version 0.2. The old ones are accepted until version 0.3."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

FEATURES: Mapping[str, str] = {
    "still": "steady_threshold",
    "n_share": "n_overlap",
    "clock": "window_reference",
    "clock_node": "reference_node",
}
"""Settings of the Fourier features: old name -> new name."""


def with_new_names(
    given: Mapping[str, Any], names: Mapping[str, str], where: str = ""
) -> dict[str, Any]:
    """Return `given` with its old keys renamed; with `where`, warn of each old key.

    If both the old and the new key are present, the old one is kept, and is then an unknown key.
    """
    renamed = {}
    for key, value in given.items():
        new = names.get(key, key)
        if new in given:
            new = key
        elif new != key and where:
            warn(f"{where}{key}", f"{where}{new}" if where.endswith(".") else new)
        renamed[new] = value
    return renamed


def warn(old: str, new: str) -> None:
    """Warn once that a name was renamed. `IS_RENAMING` matches the message."""
    text = f"{old} is called {new} since version 0.2; the old name is read until version 0.3"
    warnings.warn(text, FutureWarning, stacklevel=3)


IS_RENAMING = r".* is called .* since version 0\.2"
"""Regular expression of these messages, for filters."""


def accepts_old_names(
    names: Mapping[str, str],
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Decorate a function so that it also accepts old keyword arguments, with a warning."""

    def decorate(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        @wraps(function)
        def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            new: Any = with_new_names(kwargs, names, f"{function.__name__}: ")
            return function(*args, **new)

        return call

    return decorate
