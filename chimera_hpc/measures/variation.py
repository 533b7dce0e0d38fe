"""Total normalised variations of phase, amplitude and frequency over pairs of nodes."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import floats

Array = NDArray[np.float64]


class HasProfiles(Protocol):
    """Anything that holds mean phase (rad), amplitude and frequency of each node, each (N,)."""

    @property
    def phase(self) -> Array: ...
    @property
    def amplitude(self) -> Array: ...
    @property
    def frequency(self) -> Array: ...


def total_variations(
    features: HasProfiles, *, ring: bool = True, pairs: ArrayLike | None = None
) -> tuple[float, float, float]:
    """Total normalised variations (V_theta, V_a, V_Omega) of a run (paper, sec. III B).

    As `total_variation_arrays`, for an object with the attributes phase, amplitude and frequency.
    The result is NaN if the features are NaN, i.e. if their status is not DONE. Features that were
    made with steady = "level" have the levels of such a run in place of the amplitudes.
    """
    heights = getattr(features, "heights", features.amplitude)
    profiles = features.phase, heights, features.frequency
    return total_variation_arrays(*profiles, ring=ring, pairs=pairs)


def total_variation_arrays(
    phase: ArrayLike,
    amplitude: ArrayLike,
    frequency: ArrayLike,
    *,
    ring: bool = True,
    pairs: ArrayLike | None = None,
) -> tuple[float, float, float]:
    r"""Total normalised variations of three profiles along a ring of N nodes, or over pairs.

        V_theta = sum_i min(v_i, 2 pi - v_i) / (pi N) ,   v_i = |theta_{i+1} - theta_i| ,
        V_a     = sum_i |a_{i+1} - a_i| / N ,
        V_Omega = sum_i |Omega_{i+1} - Omega_i| / N ,

    where node N+1 is node 1 (paper, sec. III B). For V_theta, v_i is reduced modulo 2 pi,
    so phases may be outside [0, 2 pi). V_theta is in [0, 1], V_a has the unit of the signal, and
    V_Omega that of the frequency. With ``pairs``, the sums are over these pairs of nodes, such as
    the links of a network, and are divided by their number; the order within a pair and the
    numbering of the nodes do not matter.

    Parameters
    ----------
    phase, amplitude, frequency : array_like, shape (N,)
        Phase in rad.
    ring : bool
        If False, the nodes form a chain. The sum of N - 1 differences is then divided by N - 1, so
        V is still the mean over pairs of neighbours.
    pairs : array_like of int, shape (M, 2), optional
        Pairs of nodes, in place of neighbours along the ring. Without any pair, V is NaN.

    Raises
    ------
    BadInput
        Shapes that differ, or that are not (N,) with N >= 1; for a chain N >= 2; values that are
        not real, or masked; pairs that name no nodes.

    Examples
    --------
    >>> v = total_variation_arrays([0.0, np.pi / 2, np.pi], [1.0, 3.0, 2.0], [4.0, 4.0, 1.0])
    >>> v  # (1/2 + 1/2 + 1) / 3, (2 + 1 + 1) / 3, (0 + 3 + 3) / 3
    (0.666667, 1.333333, 2.0)
    """
    names = ("phase", "amplitude", "frequency")
    given = zip(names, (phase, amplitude, frequency), strict=True)
    profiles = [floats(name, x) for name, x in given]
    shapes = {x.shape for x in profiles}
    if len(shapes) > 1 or profiles[0].ndim != 1 or profiles[0].size == 0:
        raise BadInput(
            "phase, amplitude and frequency must have one shape (nodes,), not "
            + ", ".join(str(x.shape) for x in profiles)
        )
    if not ring and profiles[0].size < 2:
        raise BadInput("a chain has at least two nodes")
    if pairs is None:
        places = slice(None) if ring else slice(-1)
        differences = [np.abs(np.roll(x, -1) - x)[places] for x in profiles]
    else:
        first, second = _checked_pairs(pairs, profiles[0].size).T
        if not len(first):
            return (np.nan, np.nan, np.nan)
        differences = [np.abs(x[second] - x[first]) for x in profiles]
    v_phase, v_amplitude, v_frequency = differences
    v_phase %= 2.0 * np.pi
    v_phase = np.minimum(v_phase, 2.0 * np.pi - v_phase)
    return (
        float(v_phase.mean() / np.pi),
        float(v_amplitude.mean()),
        float(v_frequency.mean()),
    )


def _checked_pairs(pairs: ArrayLike, n_nodes: int) -> NDArray[np.int64]:
    found = np.asarray(pairs)
    if found.size == 0:
        return np.empty((0, 2), dtype=np.int64)
    if found.ndim != 2 or found.shape[1] != 2 or found.dtype.kind not in "iu":
        raise BadInput(f"pairs must be whole numbers of shape (pairs, 2), not {found.shape}")
    if found.min() < 0 or found.max() >= n_nodes:
        raise BadInput(f"pairs name the nodes {found.min()} to {found.max()}: 0 to {n_nodes - 1}")
    return found.astype(np.int64)
