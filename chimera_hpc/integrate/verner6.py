"""Verner 6(5), the pair of the classical code DVERK, with an interpolant of order 5."""

import numpy as np

from chimera_hpc.integrate.tableau import Tableau, lower_triangular

# Stage 9 is not Verner's: it is the derivative at the middle of the step, reached with the weights
# of order 4 that stages 1 to 6 allow there. With it the order conditions of the interpolant have
# one family of solutions, of which this is the one whose derivative is continuous over the steps.
VERNER6 = Tableau(
    name="verner6",
    order=6,
    error_order=5,
    a=lower_triangular(
        (1 / 6,),
        (4 / 75, 16 / 75),
        (5 / 6, -8 / 3, 5 / 2),
        (-165 / 64, 55 / 6, -425 / 64, 85 / 96),
        (12 / 5, -8.0, 4015 / 612, -11 / 36, 88 / 255),
        (-8263 / 15000, 124 / 75, -643 / 680, -81 / 250, 2484 / 10625),
        (3501 / 1720, -300 / 43, 297275 / 52632, -319 / 2322, 24068 / 84065, 0.0, 3850 / 26703),
        (43 / 512, 0.0, 2125 / 5632, 11 / 256, 0.0, -3 / 704),
        (3 / 40, 0.0, 875 / 2244, 23 / 72, 264 / 1955, 0.0, 125 / 11592, 43 / 616),
    ),
    e=np.array(
        [
            -1 / 160,
            0.0,
            -125 / 17952,
            1 / 144,
            -12 / 1955,
            -3 / 44,
            125 / 11592,
            43 / 616,
            0.0,
            0.0,
        ]
    ),
    p=np.array(
        [
            [1.0, -683 / 160, 631 / 80, -211 / 32, 41 / 20],
            [0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 153625 / 17952, -225125 / 8976, 474625 / 17952, -7125 / 748],
            [0.0, 463 / 144, -911 / 72, 2485 / 144, -15 / 2],
            [0.0, 1284 / 1955, -8136 / 1955, 2748 / 391, -288 / 85],
            [0.0, -9 / 44, -27 / 22, 135 / 44, -18 / 11],
            [0.0, 3875 / 11592, -3625 / 5796, 125 / 414, 0.0],
            [0.0, 129 / 616, -43 / 308, 0.0, 0.0],
            [0.0, -8.0, 32.0, -40.0, 16.0],
            [0.0, -1 / 2, 4.0, -15 / 2, 4.0],
        ]
    ),
    interpolant_order=5,
    source="Verner, SIAM J. Numer. Anal. 15 (1978) 772, doi:10.1137/0715051; the interpolant from "
    "its order conditions, solved in rational numbers",
)
