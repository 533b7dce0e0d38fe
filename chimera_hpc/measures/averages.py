"""Kernels for means and standard deviations over windows."""

from __future__ import annotations

import math
from typing import Any

from chimera_hpc.integrate.jit import jit

# Row of the phases among amplitude, frequency, phase, baseline and R^2.
_PHASE = 2


@jit()
def average(values: Any, counts: Any, circular: bool, out: Any) -> None:
    """Write means and standard deviations over windows of values (5, N, q) into out (9, N).

    For the last row, R^2, only the mean is written.
    """
    for j in range(values.shape[1]):
        q = counts[j % counts.size]
        for row in range(4):
            x = values[row, j, :q]
            around = circular and row == _PHASE
            mean = _circular_mean(x) if around else _mean(x)
            square = 0.0
            for m in range(q):
                deviation = x[m] - mean
                if around:
                    deviation -= 2.0 * math.pi * math.floor(0.5 * deviation / math.pi + 0.5)
                square += deviation * deviation
            out[row, j] = mean
            out[row + 4, j] = math.sqrt(square / (q - 1)) if q > 1 else math.nan
        out[8, j] = _mean(values[4, j, :q])


@jit()
def _mean(x: Any) -> float:
    """Return the mean of x, which is exact if all values are equal."""
    origin = x[0]
    total = 0.0
    for m in range(x.size):
        total += x[m] - origin
    mean: float = origin + total / x.size
    return mean


@jit()
def _circular_mean(x: Any) -> float:
    """Return the argument of the mean of exp(i x), in [-pi, pi); 0 if that mean is zero."""
    along, across = 0.0, 0.0
    for m in range(x.size):
        along += math.cos(x[m])
        across += math.sin(x[m])
    mean = math.atan2(across, along)
    return mean if mean < math.pi else -math.pi
