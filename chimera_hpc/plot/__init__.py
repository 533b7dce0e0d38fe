"""Figures as functions: arrays in, matplotlib Figure out.

`space_time`, `profiles`, `variations` and `classes` take the dataset that `chimera_hpc.open` gives.
"""

from chimera_hpc.base.public import load_on_use

TYPE_CHECKING = False

if TYPE_CHECKING:
    from chimera_hpc.plot.of_data import classes, profiles, space_time, variations

__all__ = ["classes", "profiles", "space_time", "variations"]

__getattr__, __dir__ = load_on_use(
    __name__, {name: (f"{__name__}.of_data", name) for name in __all__}
)
