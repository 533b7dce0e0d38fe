"""Kennedy-Carpenter-Lewis 4(3), a pair that needs to store two states only.

Each stage looks at the slope before it and at the sum of the earlier ones, weighted as the solution
weights them. The stepping loop, which keeps all stages of a method, makes no use of that: it is
here to be compared with the others at what it costs and how exact it is.
"""

import numpy as np

from chimera_hpc.integrate.tableau import Tableau, hermite, lower_triangular

_B = (
    1153189308089 / 22510343858157,
    1772645290293 / 4653164025191,
    -1672844663538 / 4480602732383,
    2114624349019 / 3568978502595,
    5198255086312 / 14908931495163,
)
_EMBEDDED = (
    1016888040809 / 7410784769900,
    11231460423587 / 58533540763752,
    -1563879915014 / 6823010717585,
    606302364029 / 971179775848,
    1097981568119 / 3980877426909,
)
_A = lower_triangular(
    (970286171893 / 4311952581923,),
    (*_B[:1], 6584761158862 / 12103376702013),
    (*_B[:2], 2251764453980 / 15575788980749),
    (*_B[:3], 26877169314380 / 34165994151039),
    _B,
)

KCL4 = Tableau(
    name="kcl4",
    order=4,
    error_order=3,
    a=_A,
    e=np.append(np.subtract(_B, _EMBEDDED), 0.0),
    p=hermite(_A[-1]),
    interpolant_order=3,
    source="Kennedy, Carpenter, Lewis, Appl. Numer. Math. 35 (2000) 177, RK4(3)5[2R+]C, "
    "doi:10.1016/S0168-9274(99)00141-5; interpolant: the cubic through both ends of the step",
)
