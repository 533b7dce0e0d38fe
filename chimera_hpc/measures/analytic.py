r"""Amplitude, frequency and phase of each node by the analytic signal, or by a wavelet ridge.

Both write a signal as ``u - <u> ~ A(t) cos(phi(t))`` and average over the recording without its
ends, t_1 to t_2:

    a = <A> ,   Omega = (phi(t_2) - phi(t_1)) / (2 pi (t_2 - t_1)) ,
    theta = arg <exp(i (phi - phi_0))> ,

with phi_0 the phase of a reference node, so that theta compares nodes as the windows of `fourier`
do, which begin at a maximum of that node.

- Hilbert: A exp(i phi) is the analytic signal. It needs a narrow band. M. Rosenblum, J. Kurths,
  Handbook of Biological Physics 4, 279 (2001), doi:10.1016/S1383-8121(01)80012-9.
- Wavelet: A exp(i phi) is the continuous wavelet transform along its ridge, the frequency of the
  largest modulus at each time. It follows the strongest of several components, and costs about a
  hundred times what windows do. S. Mallat, A Wavelet Tour of Signal Processing (2009), sec. 4.4,
  doi:10.1016/B978-0-12-374370-1.X0001-8.

>>> t = 0.01 * np.arange(4000)
>>> u = 3 + np.stack([np.cos(2 * np.pi * t), 2 * np.cos(2 * np.pi * t + 1)], axis=1)
>>> for found in (hilbert_features(t, u), wavelet_features(t, u)):
...     print(found.amplitude.round(2), found.frequency.round(2), found.phase.round(2))
[1. 2.] [1. 1.] [0. 1.]
[1. 2.] [1. 1.] [0. 1.]
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy.signal import hilbert

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array
from chimera_hpc.measures.signals_input import (
    CheckedSignals,
    check_node,
    checked_signals,
    suspect_signals,
)

ENDS = 0.05
"""Share of the recording at each end that is left out: transforms are inexact there."""
_CYCLES = 6.0
"""Centre frequency of the Morlet wavelet in units of its width: about 6 / (2 pi) periods."""
_PER_OCTAVE = 12
_FEWEST_PERIODS = 5.0
"""Periods in the recording of the lowest frequency of the wavelets."""
_FEWEST_SAMPLES = 4.0
"""Samples per period of the highest."""
_LEAST = 0.25
"""Least amplitude of a ridge that follows its signal, in units of the signal's."""

Complex = NDArray[np.complex128]


class NodeProfiles(NamedTuple):
    """Mean phase (rad), amplitude and frequency (cycles per unit of time) of N nodes, (N,) each."""

    phase: Array
    amplitude: Array
    frequency: Array


def hilbert_features(t: ArrayLike, u: ArrayLike, *, reference_node: int = 0) -> NodeProfiles:
    """Mean phase, amplitude and frequency of each signal by its analytic signal.

    Parameters
    ----------
    t : array_like, shape (T,)
        Uniform times.
    u : array_like, shape (T, N)
    reference_node : int
        Node (from 0) whose phase is taken off.

    Raises
    ------
    BadInput
        As `fourier_features`.

    Warns
    -----
    UserWarning
        As `fourier_features`, for constant, rising or swapped signals.
    """
    given = _looked_at("hilbert_features", t, u)
    made: Complex = hilbert(given.x - given.x.mean(axis=1, keepdims=True), axis=1)
    return _averages(made, given.dt, check_node(reference_node, len(made)))


def wavelet_features(
    t: ArrayLike,
    u: ArrayLike,
    *,
    low: float | None = None,
    high: float | None = None,
    reference_node: int = 0,
) -> NodeProfiles:
    """Mean phase, amplitude and frequency of each signal along the ridge of a Morlet transform.

    Parameters
    ----------
    t : array_like, shape (T,)
        Uniform times.
    u : array_like, shape (T, N)
    low, high : float, optional
        Lowest and highest frequency of the ridge. Default: 5 periods in the recording, and 4
        samples per period.
    reference_node : int
        Node (from 0) whose phase is taken off.

    Raises
    ------
    BadInput
        As `fourier_features`, or an empty range of frequencies.

    Warns
    -----
    UserWarning
        As `hilbert_features`, or a signal below the lowest frequency.
    """
    given = _looked_at("wavelet_features", t, u)
    x, step = given.x - given.x.mean(axis=1, keepdims=True), given.dt
    lowest = _FEWEST_PERIODS / (step * x.shape[1]) if low is None else low
    highest = 1.0 / (_FEWEST_SAMPLES * step) if high is None else high
    if not 0.0 < lowest < highest <= 0.5 / step:
        raise BadInput(
            f"wavelet frequencies from {lowest:.3g} to {highest:.3g}: they must rise, from above "
            f"0 to at most {0.5 / step:.3g}, half the sampling frequency"
        )
    ridge = _ridge(x, step, lowest, highest)
    found = _averages(ridge, step, check_node(reference_node, len(x)))
    missed = found.amplitude < _LEAST * np.sqrt(2.0) * x.std(axis=1)
    slow = missed | ((found.frequency < lowest) & (found.amplitude > 0.0))
    if slow.any():
        warnings.warn(
            f"wavelet_features: node {int(np.argmax(slow))} (column of u) is slower than "
            f"the lowest frequency, {lowest:.3g}; take a longer recording, or give low",
            UserWarning,
            stacklevel=2,
        )
    return found


def _looked_at(name: str, t: ArrayLike, u: ArrayLike) -> CheckedSignals:
    """Return checked signals, and warn of unlikely signals, as `fourier_features` does."""
    given = checked_signals(t, u)
    finite = np.isfinite(given.x).all(axis=1)
    if not finite.all():
        raise BadInput(f"u must be finite: node {int(np.argmin(finite))} (column of u) is not")
    for line in suspect_signals(given.x):
        warnings.warn(f"{name}: {line}", UserWarning, stacklevel=3)
    return given


def _ridge(x: Array, step: float, lowest: float, highest: float) -> Complex:
    """Return the transform of each row of x (N, T) at its largest modulus at each time."""
    n_times = fft.next_fast_len(2 * x.shape[1], real=True)
    spectrum = fft.rfft(x, n_times, axis=1)
    frequencies = fft.rfftfreq(n_times, step)
    count = 1 + int(np.ceil(_PER_OCTAVE * np.log2(highest / lowest)))
    best: Complex = np.zeros(x.shape, dtype=np.complex128)
    whole = np.zeros((len(x), n_times), dtype=np.complex128)
    for centre in np.geomspace(lowest, highest, count):
        weight = 2.0 * np.exp(-0.5 * (_CYCLES * (frequencies / centre - 1.0)) ** 2)
        whole[:, : len(frequencies)] = spectrum * weight
        made = fft.ifft(whole, axis=1)[:, : x.shape[1]]
        larger = np.abs(made) > np.abs(best)
        best[larger] = made[larger]
    return best


def _averages(made: Complex, step: float, reference: int) -> NodeProfiles:
    """Return the averages of complex amplitudes (N, T) over time."""
    cut = int(ENDS * made.shape[1])
    inner = made[:, cut : made.shape[1] - cut]
    phase = np.unwrap(np.angle(inner), axis=1)
    turns = (phase[:, -1] - phase[:, 0]) / (2.0 * np.pi)
    relative = np.exp(1j * (phase - phase[reference])).mean(axis=1)
    return NodeProfiles(
        np.angle(relative), np.abs(inner).mean(axis=1), turns / (step * (inner.shape[1] - 1))
    )
