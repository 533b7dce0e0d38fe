"""Kernels for the dominant spectral line of one window: the three steps of the Fourier method.

All steps use the sums C = sum z_i cos(w i) and S = sum z_i sin(w i) of the centred samples z at an
angular frequency w per sample, at a bin of the discrete Fourier transform or between bins. A window
over n_peaks maxima has its dominant line near bin n_peaks - 1, so few bins are needed. By
Parseval's theorem,

    sum over k = 1 .. n-1 of |X_k|^2 = n sum z_i^2 ,

the energy that remains after the bins computed so far is a bound for every other bin. The search
ends when this bound is less than the largest line. The result is that of the full transform, which
is slow at window lengths with large prime factors. (If broadband noise has more energy than the
line, the search computes all bins, at 10 to 20 times the cost.)

Each sum is made of SUMS independent partial sums in a fixed order, so the bits are the same on all
machines.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import LANES, broadcast, fold, load_at, store_at

# Number of partial sums, in two vectors.
SUMS = 2 * LANES
ROWS = 4
BLOCK = SUMS * ROWS
# Number of bins whose rotations are cached: the signals of a ring share their windows.
SLOTS = 8

# Bound for the relative rounding error of a window's energy balance.
_BALANCE = 1e-12
_MAX_STEPS = 50
_MAX_HALVINGS = 10
# Gauss-Newton steps end when a step changes the angle at the window's ends by less (rad).
_SMALL_ANGLE = 1e-12


class Work(NamedTuple):
    """Work arrays of the kernels, for windows of up to a given number of samples."""

    z: NDArray[np.float64]  # centred samples, zero-padded to whole blocks
    z_s: NDArray[np.float64]  # the same times s, the place from the middle; for the sine fit
    power: NDArray[np.float64]  # |X_k|^2
    turn: NDArray[np.float64]  # (SLOTS + 1, 3, SUMS), see `_begin_turning`
    sums: NDArray[np.float64]  # (SUMS,)


def work_arrays(longest: int) -> Work:
    """Work arrays for windows of up to `longest` samples."""
    padded = -(-longest // BLOCK) * BLOCK
    return Work(
        np.empty(padded),
        np.empty(padded),
        np.empty(longest // 2 + 2),
        np.zeros((SLOTS + 1, 3, SUMS)),
        np.empty(SUMS),
    )


@jit()
def centre(x, first, n, z, sums):
    """Write x[first:first+n] minus its mean into z; return mean, energy, alternating sum.

    The energy is sum z_i^2 and the alternating sum is sum (-1)^i x_i, the Nyquist bin for even n
    (meaningless for odd n). Equal samples have an energy of exactly zero.
    """
    origin = x[first]
    padded = (n + BLOCK - 1) // BLOCK * BLOCK
    whole = n // BLOCK * BLOCK
    for i in range(whole, padded):
        z[i] = x[first + i] - origin if i < n else 0.0
    low, high = broadcast(0.0), broadcast(0.0)
    for start in range(0, padded, BLOCK):
        if start < whole:
            for i in range(start, start + BLOCK, LANES):
                store_at(z, i, load_at(x, first + i) - origin)
        low = low + _four_rows(z, start)
        high = high + _four_rows(z, start + LANES)
    store_at(sums, 0, low)
    store_at(sums, LANES, high)
    total, alternating = 0.0, 0.0
    for b in range(0, SUMS, 2):
        total += sums[b] + sums[b + 1]
        alternating += sums[b] - sums[b + 1]
    mean = total / n

    for i in range(whole, n):
        z[i] -= mean
    low, high = broadcast(0.0), broadcast(0.0)
    for start in range(0, padded, BLOCK):
        if start < whole:
            for i in range(start, start + BLOCK, LANES):
                store_at(z, i, load_at(z, i) - mean)
        low = low + _four_squares(z, start)
        high = high + _four_squares(z, start + LANES)
    store_at(sums, 0, low)
    store_at(sums, LANES, high)
    energy = 0.0
    for b in range(SUMS):
        energy += sums[b]
    return origin + mean, energy, alternating


@jit()
def _four_rows(z, start):
    y0, y1 = load_at(z, start), load_at(z, start + SUMS)
    y2, y3 = load_at(z, start + 2 * SUMS), load_at(z, start + 3 * SUMS)
    return (y0 + y1) + (y2 + y3)


@jit()
def _four_squares(z, start):
    y0, y1 = load_at(z, start), load_at(z, start + SUMS)
    y2, y3 = load_at(z, start + 2 * SUMS), load_at(z, start + 3 * SUMS)
    return (y0 * y0 + y1 * y1) + (y2 * y2 + y3 * y3)


@jit()
def _weighted(z, start, a0, a1, a2, a3):
    y0, y1 = load_at(z, start), load_at(z, start + SUMS)
    y2, y3 = load_at(z, start + 2 * SUMS), load_at(z, start + 3 * SUMS)
    return (y0 * a0 + y1 * a1) + (y2 * a2 + y3 * a3)


@jit()
def line_sums(z, n, w, turn):
    """C = sum z_i cos(w i) and S = sum z_i sin(w i), i = 0 .. n-1.

    With i = SUMS a + b and the addition theorem, only cos and sin of w b and of w SUMS a are
    needed, which come from one cosine and one sine by rotations.
    """
    _begin_turning(w, turn[SLOTS])
    c, s = _turning_sums(z, n, turn[SLOTS])
    return c, s


@jit()
def _turning_sums(z, n, turn):
    c, s = turn[2, 0], turn[2, 1]
    # (c_r, s_r) is the angle of row r of a block; (c, s) turns by one row, (c4, s4) by a block
    c2, s2 = c * c - s * s, 2.0 * c * s
    c4, s4 = c2 * c2 - s2 * s2, 2.0 * c2 * s2
    c0, s0 = 1.0, 0.0
    c1, s1 = c, s
    c3, s3 = c2 * c - s2 * s, s2 * c + c2 * s
    p_low, p_high, q_low, q_high = broadcast(0.0), broadcast(0.0), broadcast(0.0), broadcast(0.0)
    for start in range(0, n, BLOCK):
        p_low = p_low + _weighted(z, start, c0, c1, c2, c3)
        q_low = q_low + _weighted(z, start, s0, s1, s2, s3)
        p_high = p_high + _weighted(z, start + LANES, c0, c1, c2, c3)
        q_high = q_high + _weighted(z, start + LANES, s0, s1, s2, s3)
        c0, s0 = c0 * c4 - s0 * s4, s0 * c4 + c0 * s4
        c1, s1 = c1 * c4 - s1 * s4, s1 * c4 + c1 * s4
        c2, s2 = c2 * c4 - s2 * s4, s2 * c4 + c2 * s4
        c3, s3 = c3 * c4 - s3 * s4, s3 * c4 + c3 * s4
    co_low, co_high = load_at(turn, 0), load_at(turn, LANES)
    si_low, si_high = load_at(turn, SUMS), load_at(turn, SUMS + LANES)
    along = (p_low * co_low - q_low * si_low) + (p_high * co_high - q_high * si_high)
    across = (p_low * si_low + q_low * co_low) + (p_high * si_high + q_high * co_high)
    return fold(along), fold(across)


@jit()
def _begin_turning(w, turn):
    """Write cos and sin of w b, b < SUMS, into turn[0] and turn[1], of w SUMS into turn[2]."""
    co, si = turn[0], turn[1]
    c, s = math.cos(w), math.sin(w)
    co[0], si[0] = 1.0, 0.0
    m = 1
    while m < SUMS:
        for b in range(m):
            co[m + b] = co[b] * c - si[b] * s
            si[m + b] = si[b] * c + co[b] * s
        c, s = c * c - s * s, 2.0 * c * s
        m *= 2
    turn[2, 0], turn[2, 1] = c, s


@jit()
def _bin_power(z, n, k, turn):
    """|X_k|^2 of the discrete Fourier transform of z."""
    # The length and bin of cached rotations are stored with them.
    mine = turn[k % SLOTS]
    if mine[2, 2] != n or mine[2, 3] != k:
        _begin_turning(2.0 * math.pi * k / n, mine)
        mine[2, 2], mine[2, 3] = n, k
    c, s = _turning_sums(z, n, mine)
    power: float = c * c + s * s
    return power


@jit()
def dominant_bin(
    z,
    n,
    energy,
    alternating,
    guess,
    power,
    turn,
):
    """Return the lowest bin k >= 1 with the largest |X_k|. Fills power[k-1 : k+2].

    The bins are searched outwards from `guess` until the remaining energy is too small for a larger
    line (see the module's docstring). The guess affects the cost, not the result.
    """
    top = (n - 1) // 2  # highest bin below the Nyquist frequency
    left = 0.5 * n * energy
    margin = _BALANCE * left
    best, at = -1.0, 0
    if n % 2 == 0:
        best, at = alternating * alternating, n // 2
        power[at] = best
        left -= 0.5 * best
    low = min(max(guess, 1), top)
    high = low - 1
    down = False
    while low > 1 or high < top:
        if high < low or (high < top and (low == 1 or not down)):
            high += 1
            k = high
        else:
            low -= 1
            k = low
        down = not down
        power[k] = _bin_power(z, n, k, turn)
        left -= power[k]
        if power[k] > best or (power[k] == best and k < at):
            best, at = power[k], k
        if left + margin < best:
            break
    for k in range(max(at - 1, 1), min(at + 1, top) + 1):
        if k < low or k > high:
            power[k] = _bin_power(z, n, k, turn)
    return at


@jit()
def parabola_shift(power, k, n):
    """Distance, in bins, from bin k to the vertex of the parabola through bins k-1, k, k+1.

    The parabola goes through the amplitudes |X|. The shift is 0 at the edges of the spectrum: at
    the last bin, and at bin 1, whose lower neighbour is the subtracted mean.
    """
    if k <= 1 or k >= n // 2:
        return 0.0
    below, here, above = math.sqrt(power[k - 1]), math.sqrt(power[k]), math.sqrt(power[k + 1])
    curvature = (below - here) + (above - here)
    if curvature == 0.0:
        return 0.0
    return 0.5 * (below - above) / curvature


@jit()
def _kernel_sum(n, w):
    """Sum of cos(w s) over s = -(n-1)/2 .. (n-1)/2, the Dirichlet kernel."""
    return math.sin(0.5 * n * w) / math.sin(0.5 * w)


@jit()
def fit_at(z, n, w, turn):
    """Least squares of A cos(w s) + B sin(w s) + K to the centred samples, 0 < w < pi.

    s = i - (n-1)/2 is measured from the middle of the window. This decouples the sine from the
    other two terms, and the sums of the normal equations are Dirichlet kernels.

    Returns A, B, K, the energy that the fit explains, and the angle w (n-1)/2 from start to middle.
    """
    c, s = line_sums(z, n, w, turn)
    angle = 0.5 * (n - 1) * w
    cos_middle, sin_middle = math.cos(angle), math.sin(angle)
    c, s = c * cos_middle + s * sin_middle, s * cos_middle - c * sin_middle
    d1 = _kernel_sum(n, w)
    d2 = _kernel_sum(n, 2.0 * w)
    a = c / (0.5 * (n + d2) - d1 * d1 / n)
    b = s / (0.5 * (n - d2))
    return a, b, -a * d1 / n, a * c + b * s, angle


@jit()
def _newton_step(z_s, n, w, a, b, k, turn):
    """Gauss-Newton step in w of the four-parameter sine fit; z_s holds s z.

    The residual is fitted by cos, sin, 1 and the model's derivative d = s (B cos(w s) -
    A sin(w s)). The step is the coefficient of d.
    """
    c, s = line_sums(z_s, n, w, turn)
    angle = 0.5 * (n - 1) * w
    cos_middle, sin_middle = math.cos(angle), math.sin(angle)
    c, s = c * cos_middle + s * sin_middle, s * cos_middle - c * sin_middle
    d1, slope1, _ = _kernel_derivatives(n, w)
    d2, slope2, bend2 = _kernel_derivatives(n, 2.0 * w)
    second_moment = n * (float(n) * n - 1.0) / 12.0
    # inner products of d with cos, sin, 1 and itself
    with_cos = 0.5 * a * slope2
    with_sin = -0.5 * b * slope2
    with_one = a * slope1
    square = 0.5 * (a * a * (second_moment + bend2) + b * b * (second_moment - bend2))
    # part of the square that cos, sin and 1 already explain
    even = 0.5 * (n + d2)
    determinant = even * n - d1 * d1
    explained = (
        with_cos * (with_cos * n - with_one * d1) + with_one * (with_one * even - with_cos * d1)
    ) / determinant + with_sin * with_sin / (0.5 * (n - d2))
    new = square - explained
    if new <= _BALANCE * square:
        return 0.0
    step: float = (b * c - a * s - (a * with_cos + b * with_sin + k * with_one)) / new
    return step


@jit()
def _kernel_derivatives(n, w):
    """Dirichlet kernel and its first two derivatives with respect to w."""
    c, s = math.cos(0.5 * w), math.sin(0.5 * w)
    value = math.sin(0.5 * n * w) / s
    slope = 0.5 * (n * math.cos(0.5 * n * w) - value * c) / s
    bend = (0.25 * (1.0 - float(n) * n) * value * s - slope * c) / s
    return value, slope, bend


@jit()
def sine_fit(z, z_s, n, energy, w, turn):
    """Angular frequency of the four-parameter sine fit (IEEE Std 1057), started at w.

    A Gauss-Newton step is halved while it explains less of the energy. The frequency stays within
    one bin of the start, and half a bin away from zero and the Nyquist frequency.
    """
    one_bin = 2.0 * math.pi / n
    lowest = max(w - one_bin, 0.5 * one_bin)
    highest = min(w + one_bin, math.pi - 0.5 * one_bin)
    a, b, k, gain, _ = fit_at(z, n, w, turn)
    for _ in range(_MAX_STEPS):
        step = _newton_step(z_s, n, w, a, b, k, turn)
        accepted = False
        for _ in range(_MAX_HALVINGS):
            trial = min(max(w + step, lowest), highest)
            a, b, k, new_gain, _ = fit_at(z, n, trial, turn)
            # The gain is flat at its maximum, so rounding must not reject a good step there.
            if new_gain >= gain - _BALANCE * energy:
                accepted = True
                break
            step *= 0.5
        if not accepted:
            return w
        moved = abs(trial - w)
        w, gain = trial, new_gain
        if moved * n < _SMALL_ANGLE:
            break
    return w


@jit()
def window_line(x, first, n, guess, refine: bool, work, out):
    """Write amplitude, angular frequency per sample, phase, baseline and R^2 into out (5,).

    The phase is at the first sample. If all samples are equal, amplitude, frequency and phase are
    0, and R^2 is NaN. Returns the dominant bin, which is a good guess for the next window.
    """
    z, z_s, power, turn, sums = work
    mean, energy, alternating = centre(x, first, n, z, sums)
    if energy == 0.0:
        out[0], out[1], out[2], out[3], out[4] = 0.0, 0.0, 0.0, mean, math.nan
        return guess
    at: int = dominant_bin(z, n, energy, alternating, guess, power, turn)
    if 2 * at == n:
        # The sine is zero at every sample; only amplitude and sign of (-1)^i remain.
        out[0], out[1], out[3] = abs(alternating) / n, math.pi, mean
        out[2] = 0.0 if alternating >= 0.0 else -math.pi
        out[4] = alternating * alternating / (n * energy)
        return at
    w = 2.0 * math.pi * (at + parabola_shift(power, at, n)) / n
    if refine:
        for i in range(n):
            z_s[i] = z[i] * (i - 0.5 * (n - 1))
        for i in range(n, (n + BLOCK - 1) // BLOCK * BLOCK):
            z_s[i] = 0.0
        w = sine_fit(z, z_s, n, energy, w, turn)
    a, b, k, explained, angle = fit_at(z, n, w, turn)
    out[0] = math.sqrt(a * a + b * b)
    out[1] = w
    out[2] = math.atan2(-b, a) - angle
    out[3] = mean + k
    out[4] = explained / energy
    return at
