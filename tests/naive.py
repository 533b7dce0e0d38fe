"""Slow, obvious twins of the package's kernels, written from the equations and not from the code.

Nothing here is compiled, clever or fast; a test compares a kernel with its twin on the same input.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import find_peaks

# --- features: the Fourier method ---------------------------------------------------------------


def wrap(angle):
    """Angle in [-pi, pi)."""
    return np.mod(np.asarray(angle) + np.pi, 2 * np.pi) - np.pi


def maxima(x):
    """Indices of the strict local maxima, a plateau counting once, at its middle (rounded down)."""
    return find_peaks(x)[0]


def windows(peaks, n_peaks, n_share):
    """List of (first, last) samples, both included, of the windows over a list of maxima."""
    found = []
    first = 0
    while first + n_peaks <= len(peaks):
        found.append((peaks[first], peaks[first + n_peaks - 1]))
        first += n_peaks - n_share
    return found


def dominant_frequency(y, dt):
    """Frequency of the largest line of 2|rfft|/n, moved to the vertex of the 3-point parabola."""
    n = len(y)
    spectrum = 2 * np.abs(np.fft.rfft(y - y.mean())) / n
    k = 1 + int(np.argmax(spectrum[1:]))
    shift = 0.0
    if 1 < k < len(spectrum) - 1:
        quadratic, linear, _ = np.polyfit([-1, 0, 1], spectrum[k - 1 : k + 2], 2)
        shift = -linear / (2 * quadratic)
    return (k + shift) / (n * dt)


def linear_fit(y, dt, frequency):
    """Least squares of p1 cos(2 pi f t + p2) + p3 with t from the window's start: (p1, p2, p3)."""
    angle = 2 * np.pi * frequency * dt * np.arange(len(y))
    columns = np.stack([np.cos(angle), -np.sin(angle), np.ones(len(y))], axis=1)
    p, q, baseline = np.linalg.lstsq(columns, y, rcond=None)[0]
    return np.hypot(p, q), np.arctan2(q, p), baseline


def sine_fit(y, dt, frequency):
    """Least squares over all four parameters, by a general optimiser."""
    t = dt * np.arange(len(y))
    amplitude, phase, baseline = linear_fit(y, dt, frequency)

    def residual(x):
        return x[0] * np.cos(2 * np.pi * x[1] * t) + x[2] * np.sin(2 * np.pi * x[1] * t) + x[3] - y

    def slope(x):
        c, s = np.cos(2 * np.pi * x[1] * t), np.sin(2 * np.pi * x[1] * t)
        return np.stack([c, 2 * np.pi * t * (x[2] * c - x[0] * s), s, np.ones(len(y))], axis=1)

    start = [amplitude * np.cos(phase), frequency, -amplitude * np.sin(phase), baseline]
    found = least_squares(residual, start, slope, xtol=3e-16, ftol=3e-16, gtol=3e-16).x
    return np.hypot(found[0], found[2]), found[1], np.arctan2(-found[2], found[0]), found[3]


def window_values(t, x, first, last, refine="parabola", time_origin="window"):
    """Amplitude, frequency, phase and baseline of one signal in one window."""
    dt = (t[-1] - t[0]) / (len(t) - 1)
    y = x[first : last + 1]
    if np.all(y == y[0]):
        return 0.0, 0.0, 0.0, y[0]
    frequency = dominant_frequency(y, dt)
    amplitude, phase, baseline = linear_fit(y, dt, frequency)
    if refine == "sine-fit":
        amplitude, frequency, phase, baseline = sine_fit(y, dt, frequency)
    if time_origin == "absolute":
        phase = phase - 2 * np.pi * frequency * t[first]
    return amplitude, frequency, wrap(phase), baseline


def averages(values, phase_mean="circular"):
    """Means and deviations (8,) over windows of values (n_windows, 4)."""
    mean = values.mean(axis=0)
    deviation = values - mean
    if phase_mean == "circular":
        mean[2] = wrap(np.angle(np.mean(np.exp(1j * values[:, 2]))))
        deviation[:, 2] = wrap(values[:, 2] - mean[2])
    q = len(values)
    std = np.sqrt(np.sum(deviation**2, axis=0) / (q - 1)) if q > 1 else np.full(4, np.nan)
    return np.concatenate([mean, std])


def fourier_features(
    t,
    u,
    n_peaks=10,
    n_share=5,
    clock="ring",
    clock_node=0,
    phase_mean="circular",
    refine="parabola",
    time_origin="window",
):
    """Features (8, N) of an oscillating run with at least one window in each signal."""
    rows = []
    for x in u.T:
        peaks = maxima(u[:, clock_node] if clock == "ring" else x)
        values = [
            window_values(t, x, first, last, refine, time_origin)
            for first, last in windows(peaks, n_peaks, n_share)
        ]
        rows.append(averages(np.array(values), phase_mean))
    return np.array(rows).T


def total_variations(phase, amplitude, frequency):
    """(V_theta, V_a, V_Omega), node by node."""
    n = len(phase)
    v_theta = v_a = v_omega = 0.0
    for i in range(n):
        j = (i + 1) % n
        v = abs(phase[j] - phase[i])
        v_theta += min(v, 2 * np.pi - v) / (np.pi * n)
        v_a += abs(amplitude[j] - amplitude[i]) / n
        v_omega += abs(frequency[j] - frequency[i]) / n
    return v_theta, v_a, v_omega


# --- features: incoherence and order -------------------------------------------------------------


def local_sigma(x, groups):
    """Time means of the standard deviations, group by group, of the ring's differences."""
    z = x - np.roll(x, -1, axis=1)
    centred = z - z.mean(axis=1, keepdims=True)
    parts = np.array_split(np.arange(x.shape[1]), groups)
    return np.array([np.sqrt((centred[:, part] ** 2).mean(axis=1)).mean() for part in parts])


def order_parameter(u, w):
    """Time mean of |mean over nodes of exp(i phi)|, phi the angle about each node's mean point."""
    phi = np.arctan2(w - w.mean(axis=0), u - u.mean(axis=0))
    return np.abs(np.exp(1j * phi).mean(axis=1)).mean()


# --- grid -----------------------------------------------------------------------------------------


def grid_points(axes):
    """Points of a grid as tuples, by trying every combination of all values that there could be.

    `axes` in order of declaration: name -> a list of values, ("same", other) or
    ("between", low, high, step) with integers or names; dependent axes have integers up to 60.
    """
    candidates = [axis if isinstance(axis, list) else range(61) for axis in axes.values()]
    points = (dict(zip(axes, values, strict=True)) for values in itertools.product(*candidates))
    return [tuple(point.values()) for point in points if belongs(point, axes)]


def belongs(point, axes):
    """Whether the values of a point obey every dependent axis."""
    for name, axis in axes.items():
        if axis[0] == "same" and point[name] != point[axis[1]]:
            return False
        if axis[0] == "between":
            low, high = (point.get(end, end) for end in axis[1:3])
            if point[name] not in range(low, high + 1, axis[3]):
                return False
    return True


def cells(columns):
    """Cell number of each row, cells numbered by first appearance, and the rows of the cells."""
    numbers = {}
    ids = [numbers.setdefault(row, len(numbers)) for row in zip(*columns, strict=True)]
    return ids, list(numbers)


# --- reduction: modal classes ---------------------------------------------------------------------


def modal_class(votes_of_runs, members):
    """Modal class of one cell: `votes_of_runs` lists a name a run (None: no result).

    `members` gives the size of each class over all cells, in the order that settles the last tie.
    """
    oscillating = [name for name in votes_of_runs if name in members]
    if not oscillating:
        return "steady" if any(votes_of_runs) else None
    best = None
    for name in members:
        more = best is None or oscillating.count(name) > oscillating.count(best)
        tied = not more and oscillating.count(name) == oscillating.count(best)
        if more or (tied and members[name] > members[best]):
            best = name
    return best


def entropy_bits(votes_of_runs):
    """Entropy of the votes that were cast."""
    cast = [name for name in votes_of_runs if name is not None]
    entropy = 0.0
    for name in sorted(set(cast)):
        p = cast.count(name) / len(cast)
        entropy += p * np.log2(1 / p)
    return entropy


def kernel_density(values, bandwidth, grid):
    """Gaussian kernel density estimate, bump by bump."""
    density = np.zeros(len(grid))
    for x in values:
        z = (grid - x) / bandwidth
        density += np.exp(-0.5 * z**2) / (np.sqrt(2 * np.pi) * bandwidth * len(values))
    return density
