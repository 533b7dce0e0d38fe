"""The paper's synthetic chimera, whose phases, amplitudes and frequencies are known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput

Array = NDArray[np.float64]


class Profiles(NamedTuple):
    """True amplitude, frequency and phase (rad) of each node, each (N,)."""

    amplitude: Array
    frequency: Array
    phase: Array


def synthetic_profiles(n_nodes: int = 100) -> Profiles:
    """Profiles of the paper's synthetic signal (app. B, below eq. (B1)).

    With s = j / N for the nodes j = 0 .. N-1 (the paper's node j + 1, and N = 100) and
    bump(s) = (s - l) (r - s) in the fifth [l, r] of [0, 1] that holds s,

        theta_0 = pi s ,
        a_0     = 1 + 20 bump(s) ,
        Omega_0 = 1 + 0.1 bump(s) in the second and the fourth fifth, 1 in the others.

    Raises BadInput: n_nodes below 1.
    """
    if n_nodes < 1:
        raise BadInput(f"n_nodes must be at least 1, not {n_nodes}")
    node = np.arange(n_nodes)
    s = node / n_nodes
    fifth = 5 * node // n_nodes
    bump = (s - fifth / 5) * ((fifth + 1) / 5 - s)
    return Profiles(
        amplitude=1.0 + 20.0 * bump,
        frequency=1.0 + 0.1 * bump * (fifth % 2),
        phase=np.pi * s,
    )


def synthetic_signal(t: ArrayLike, n_nodes: int = 100) -> Array:
    """Samples (T, N) of x_j(t) = a_0(j) cos(2 pi Omega_0(j) t + theta_0(j)), eq. (B1).

    t (T,): times; the paper takes [500, 1000].

    Raises BadInput: n_nodes below 1.
    """
    amplitude, frequency, phase = (profile[:, None] for profile in synthetic_profiles(n_nodes))
    times = np.asarray(t, dtype=np.float64)
    signal: Array = amplitude * np.cos(2.0 * np.pi * frequency * times + phase)
    return signal.T


def profile_error(
    true: NDArray[np.float64], found: NDArray[np.float64], periodic: bool
) -> NDArray[np.float64]:
    """Return true - found; for angles the smallest difference, in [-pi, pi)."""
    difference = true - found
    return (difference + np.pi) % (2.0 * np.pi) - np.pi if periodic else difference
