"""Figures as functions: arrays in, matplotlib Figure out.

`space_time`, `profiles`, `variations` and `classes` take the dataset that `chimera_hpc.open` gives.
"""

from importlib import import_module

TYPE_CHECKING = False

if TYPE_CHECKING:
    from chimera_hpc.plot.of_data import classes, profiles, space_time, variations

__all__ = ["classes", "profiles", "space_time", "variations"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.of_data"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
