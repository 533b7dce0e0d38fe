r"""Mean phase velocity of each node, and the plateau of nodes that share one.

    omega_i = 2 pi M_i / T ,

M_i the number of turns of node i in the time T. In a chimera, the coherent nodes lie on a plateau
and the others on an arc. I. Omelchenko, O. E. Omel'chenko, P. Hovel, E. Scholl, Phys. Rev. Lett.
110, 224101 (2013), doi:10.1103/PhysRevLett.110.224101. The unit is rad per unit of time.

>>> t = np.linspace(0, 10, 1001)
>>> phase = t[:, None] * [2.0, 2.0, 2.01, 3.0]
>>> mean_phase_velocity(t, phase), mean_phase_velocity(t, phase, count=True)
(array([2.  , 2.  , 2.01, 3.  ]), array([1.88495559, 1.88495559, 1.88495559, 2.51327412]))
>>> plateau(mean_phase_velocity(t, phase))
0.75
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures.checks import Array, floats, node_rows
from chimera_hpc.measures.measure import Orbits

PLATEAU_WIDTH = 0.01


def mean_phase_velocity(t: ArrayLike, phase: ArrayLike, *, count: bool = False) -> Array:
    """Mean phase velocity of each node in rad per unit of time, shape (N,).

    Parameters
    ----------
    t : array_like, shape (T,)
        Rising times; only the first and the last matter.
    phase : array_like, shape (T, N)
        Phase in rad, wrapped or not. It must turn by less than half a turn between samples.
    count : bool
        Count whole turns M_i, as the sources do. The default includes the last part of a turn:
        omega_i = (phi_i(T) - phi_i(0)) / T with the unwrapped phase.

    Raises
    ------
    BadInput
        A wrong shape, phases that are not finite, or times that do not rise.
    """
    angle = node_rows("phase", phase)
    times = floats("t", t)
    if times.shape != angle.shape[1:] or len(times) < 2 or not times[-1] > times[0]:
        raise BadInput(f"t must be {angle.shape[1]} (at least two) rising times, not {times.shape}")
    if not np.isfinite(angle).all():
        raise BadInput("phase must be finite")
    turned = np.unwrap(angle, axis=1)[:, -1] - angle[:, 0]
    if count:
        turned = 2.0 * np.pi * np.trunc(turned / (2.0 * np.pi))
    velocity: Array = turned / (times[-1] - times[0])
    return velocity


def plateau(velocity: ArrayLike, width: float = PLATEAU_WIDTH) -> float:
    """Share of nodes on the plateau: the largest group of nodes whose velocities are that close.

    Parameters
    ----------
    velocity : array_like, shape (N,)
    width : float
        Difference allowed within the group, a share of the mean velocity.

    Raises
    ------
    BadInput
        A wrong shape, or a width that is negative.
    """
    values = np.sort(floats("velocity", velocity))
    if values.ndim != 1 or values.size == 0 or not width >= 0:
        raise BadInput(f"plateau: velocity must be (nodes,) and width >= 0, not {width}")
    reach = values + width * abs(values.mean()) * (1.0 + 1e-12)
    group = np.searchsorted(values, reach, side="right") - np.arange(values.size)
    return float(group.max() / values.size)


def run_velocity(t: Array, orbits: Orbits) -> Array:
    """Mean phase velocity (N,) of a run by its angle about each node's mean point.

    As `mean_phase_velocity` of `phase_angles.phases`, "geometric", without an angle per sample.
    """
    x, y, x_mean, y_mean = orbits
    turns = np.empty(len(x))
    _turns(x, y, x_mean, y_mean, turns)
    first = np.arctan2(y[:, 0] - y_mean, x[:, 0] - x_mean)
    last = np.arctan2(y[:, -1] - y_mean, x[:, -1] - x_mean)
    velocity: Array = (2.0 * np.pi * turns + last - first) / float(t[-1] - t[0])
    return velocity


@jit()
def _turns(x: Any, y: Any, x_mean: Any, y_mean: Any, turns: Any) -> None:
    """Write how often each orbit crosses the negative x axis, downwards less upwards."""
    for j in range(x.shape[0]):
        count = 0
        before_x, before_y = x[j, 0] - x_mean[j], y[j, 0] - y_mean[j]
        for i in range(1, x.shape[1]):
            here_x, here_y = x[j, i] - x_mean[j], y[j, i] - y_mean[j]
            if (before_y >= 0.0) != (here_y >= 0.0):
                area = before_x * here_y - before_y * here_x
                count += before_y >= 0.0 and area > 0.0
                count -= before_y < 0.0 and area < 0.0
            before_x, before_y = here_x, here_y
        turns[j] = count
