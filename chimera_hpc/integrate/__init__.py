"""Adaptive Runge-Kutta integration of many trajectories at once, in numba.

A new method is one file with one `Tableau` and one line in `METHODS`.
"""

from chimera_hpc.integrate.dopri5 import DOPRI5
from chimera_hpc.integrate.kcl4 import KCL4
from chimera_hpc.integrate.tableau import Tableau
from chimera_hpc.integrate.tsit5 import TSIT5
from chimera_hpc.integrate.verner6 import VERNER6

METHODS: dict[str, Tableau] = {method.name: method for method in (TSIT5, DOPRI5, VERNER6, KCL4)}

__all__ = ["METHODS", "Tableau"]
