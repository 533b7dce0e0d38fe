r"""Centre of mass of each oscillator: amplitude chimeras.

    r_i = sqrt( <u_i>_t^2 + <w_i>_t^2 ) ,

the distance of the orbit's mean from the origin. In an amplitude chimera the incoherent nodes
oscillate about points off the origin, all with one frequency. A. Zakharova, M. Kapeller, E. Scholl,
Phys. Rev. Lett. 112, 154101 (2014), doi:10.1103/PhysRevLett.112.154101. The unit is that of u. The
mean is over all times: a part of a period at the end shifts it by up to the amplitude over the
number of periods.

>>> angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)[:, None]
>>> centre_of_mass(np.cos(angle) + [0.0, 3.0], np.sin(angle) + [0.0, 4.0]).round(12)
array([0., 5.])
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array, node_rows


def centre_of_mass(u: ArrayLike, w: ArrayLike | None = None) -> Array:
    """Distance of each node's mean point from the origin, shape (N,).

    Parameters
    ----------
    u, w : array_like, shape (T, N)
        Two components of the state; without w, the result is ``|<u_i>|``.

    Raises
    ------
    BadInput
        Shapes that are wrong or differ, or a value that is not finite.
    """
    parts = [node_rows("u", u)] + ([] if w is None else [node_rows("w", w)])
    if len({part.shape for part in parts}) > 1:
        raise BadInput(f"u and w must have one shape, not {[part.T.shape for part in parts]}")
    distance: Array = np.sqrt(sum(np.square(part.mean(axis=1)) for part in parts))
    if not np.isfinite(distance).all():
        raise BadInput("u and w must be finite")
    return distance
