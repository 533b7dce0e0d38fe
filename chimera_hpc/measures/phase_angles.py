r"""Phases of oscillators by three methods.

- "geometric": the angle of (u, w) about each node's mean point, atan2(w - <w>, u - <u>). Exact for
  orbits that turn about their mean; needs two components.
- "hilbert": the angle of the analytic signal of u - <u>. Needs a narrow band; the first and the
  last periods are less accurate unless the record holds whole periods.
- "fourier": the phase of each node's Fourier line, 2 pi Omega_i t + theta_i, see `fourier`. One
  frequency for the whole record.

On a sine of whole periods all three agree. Rosenblum and others, Handbook of Biological Physics 4,
279 (2001), doi:10.1016/S1383-8121(01)80012-9.

>>> angle = 2 * np.pi * np.arange(2000)[:, None] / 100 + [0.0, 1.0]
>>> u, w = 5 + 3 * np.cos(angle), 3 * np.sin(angle)
>>> same = [phases(u, w, "geometric"), phases(u, method="hilbert"), phases(u, method="fourier")]
>>> [float(np.abs(np.exp(1j * (found - angle)) - 1).max()) < 1e-3 for found in same]
[True, True, True]
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array, choice, node_rows

METHODS = ("geometric", "hilbert", "fourier")


def phases(u: ArrayLike, w: ArrayLike | None = None, method: str | None = None) -> Array:
    """Phase of each node at each time in rad, in [-pi, pi], shape (T, N).

    Parameters
    ----------
    u, w : array_like, shape (T, N)
        Components of the state, on a uniform grid of times. w is for "geometric" only.
    method : {"geometric", "hilbert", "fourier"}, optional
        Default: "geometric" with w, else "hilbert".

    Raises
    ------
    BadInput
        An unknown method, a w that is missing, wrong shapes, values that are not finite; with
        "fourier", a signal without 10 maxima.
    """
    method = ("hilbert" if w is None else "geometric") if method is None else method
    choice("method", method, METHODS)
    x = node_rows("u", u)
    if not np.isfinite(x).all():
        raise BadInput("u must be finite")
    if method == "geometric":
        return _geometric(x, w)
    return _hilbert(x) if method == "hilbert" else _fourier(x)


def _geometric(x: Array, w: ArrayLike | None) -> Array:
    if w is None:
        raise BadInput('method "geometric" needs w, a second component; or take "hilbert"')
    y = node_rows("w", w)
    if x.shape != y.shape:
        raise BadInput(f"u and w must have one shape, not {x.T.shape} and {y.T.shape}")
    dx, dy = (part - part.mean(axis=1, keepdims=True) for part in (x, y))
    if not np.isfinite(dy).all():
        raise BadInput("w must be finite")
    angle: Array = np.arctan2(dy, dx)
    return angle.T


def _hilbert(x: Array) -> Array:
    from scipy.signal import hilbert

    angle: Array = np.angle(hilbert(x - x.mean(axis=1, keepdims=True), axis=1))
    return angle.T


def _fourier(x: Array) -> Array:
    from chimera_hpc.base.status import Status
    from chimera_hpc.measures.fourier import measure_signals, wrap

    time = np.arange(x.shape[1], dtype=np.float64)
    found = measure_signals(
        time,
        x.T,
        window_reference="own",
        refine="sine-fit",
        time_origin="absolute",
        steady_threshold=0.0,
    )
    if found.status is not Status.DONE:
        raise BadInput('method "fourier": a signal has fewer than 10 maxima')
    return wrap(2.0 * np.pi * found.frequency * time[:, None] + found.phase)
