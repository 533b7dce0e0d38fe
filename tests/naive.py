"""Slow, obvious twins of the package's kernels, written from the equations and not from the code.

Nothing here is compiled, clever or fast; a test compares a kernel with its twin on the same input.
"""

from __future__ import annotations

import itertools
import math
from functools import partial

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


def windows(peaks, n_peaks, n_overlap):
    """List of (first, last) samples, both included, of the windows over a list of maxima."""
    found = []
    first = 0
    while first + n_peaks <= len(peaks):
        found.append((peaks[first], peaks[first + n_peaks - 1]))
        first += n_peaks - n_overlap
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
    n_overlap=5,
    window_reference="ring",
    reference_node=0,
    phase_mean="circular",
    refine="parabola",
    time_origin="window",
):
    """Features (8, N) of an oscillating run with at least one window in each signal."""
    rows = []
    for x in u.T:
        peaks = maxima(u[:, reference_node] if window_reference == "ring" else x)
        values = [
            window_values(t, x, first, last, refine, time_origin)
            for first, last in windows(peaks, n_peaks, n_overlap)
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


def stands_out(x, peak, prominence):
    """Whether a maximum rises `prominence` above the higher of the lowest points on its sides."""
    lowest = []
    for side in (x[:peak][::-1], x[peak + 1 :]):
        higher = np.flatnonzero(side > x[peak])
        lowest.append(side[: higher[0] if higher.size else None].min())
    return x[peak] - max(lowest) >= prominence


def polished(y, frequency):
    """Frequency per sample of the least-squares sine, by Gauss-Newton steps with `lstsq`."""
    s = np.arange(y.size) - (y.size - 1) / 2
    for _ in range(20):
        c, d = np.cos(2 * np.pi * frequency * s), np.sin(2 * np.pi * frequency * s)
        (a, b, _), *_ = np.linalg.lstsq(np.c_[c, d, np.ones_like(s)], y, rcond=None)
        slope = 2 * np.pi * s * (b * c - a * d)
        step = np.linalg.lstsq(np.c_[c, d, np.ones_like(s), slope], y, rcond=None)[0][3]
        frequency += step
    return frequency


def paper_printed(t, u, n_peaks=10, n_overlap=5, max_windows=4, prominence=0.1, still=1e-2):
    """V_theta, V_a, V_Omega by the recipe of the preset paper-printed, written from its text."""
    dt = (t[-1] - t[0]) / (t.size - 1)
    variation = lambda z: np.abs(np.roll(z, -1) - z).mean()  # noqa: E731
    level = (0.0, variation(u.mean(axis=0)), 0.0)
    if u.std(axis=0).mean() < still:
        return level
    means = []
    for x in u.T:
        peaks = np.array([k for k in maxima(x) if stands_out(x, k, prominence)], dtype=int)
        rows = []
        for first, last in windows(peaks, n_peaks, n_overlap)[:max_windows]:
            y = x[first : last + 1] - x[first : last + 1].mean()
            s = np.arange(y.size)
            f = polished(y, dominant_frequency(y, 1.0))
            angle = 2 * np.pi * f * s
            basis = np.c_[np.cos(angle), np.sin(angle), np.ones_like(s)]
            (a, b, _), *_ = np.linalg.lstsq(basis, y, rcond=None)
            rows.append((wrap(np.arctan2(-b, a) - 2 * np.pi * f * first), np.hypot(a, b), f / dt))
        if not rows:
            return level
        means.append(np.mean(rows, axis=0))
    return total_variations(*np.array(means).T)


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


def neighbours_of(node, pairs):
    """The other ends of a node's pairs."""
    return sorted({b for a, b in pairs if a == node} | {a for a, b in pairs if b == node})


def ring_pairs(n):
    """Pairs of next nodes around a ring."""
    return [(i, (i + 1) % n) for i in range(n)]


def local_order(phase, pairs):
    """|mean of exp(i phi)| over each node and its neighbours, time by time."""
    groups = [[i, *neighbours_of(i, pairs)] for i in range(phase.shape[1])]
    return np.array([[abs(np.mean(np.exp(1j * row[g]))) for g in groups] for row in phase])


def g0(u, pairs, delta=0.01):
    """Share of nodes whose |sum of differences to the neighbours| is below delta of the largest."""
    nodes = range(u.shape[1])
    curvature = np.array(
        [[abs(sum(row[j] - row[i] for j in neighbours_of(i, pairs))) for i in nodes] for row in u]
    )
    return (curvature < delta * curvature.max()).mean(axis=1)


def g0_global(u, delta=0.01):
    """Root of the share of pairs of nodes that are closer than delta of the largest distance."""
    pairs = list(itertools.combinations(range(u.shape[1]), 2))
    distance = np.array([[abs(row[i] - row[j]) for i, j in pairs] for row in u])
    return np.sqrt((distance < delta * distance.max()).mean(axis=1))


def adaptive_coherence(u, threshold):
    """chi^2 after each signal is moved to its first rise in the first half, and the delays."""
    half, delays = len(u) // 2, []
    for x in u.T:
        rises = [k for k in range(half - 2) if x[k + 1] < threshold < x[k + 2]]
        delays.append(rises[0] if rises else 0)
    n = len(u) - max(delays)
    moved = np.array([x[d : d + n] for x, d in zip(u.T, delays, strict=True)])
    return np.var(moved.mean(axis=0)) / np.var(moved, axis=1).mean(), len(set(delays))


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
        steady, slow = votes_of_runs.count("steady"), votes_of_runs.count("no_window")
        return ("steady" if steady > slow else "no_window") if steady + slow else None
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


# --- topology and models --------------------------------------------------------------------------


def ring_links(n, half, orientation=1):
    """(tail, head) of every link, node by node and step by step."""
    links = []
    for i in range(n):
        for k in range(1, half + 1):
            ends = (i, (i + k) % n)
            links.append(tuple(sorted(ends)) if orientation == 2 else ends)
    return links


def incidence(n, links):
    """Dense incidence matrix: +1 at the head and -1 at the tail of each link."""
    matrix = np.zeros((n, len(links)))
    for column, (tail, head) in enumerate(links):
        matrix[tail, column] -= 1.0
        matrix[head, column] += 1.0
    return matrix


def full_rhs(y, links, n, epsilon, b, c):
    """Right-hand side of the node-link equations, (n + n_links,)."""
    matrix = incidence(n, links)
    u, v = y[:n], y[n:]
    return np.concatenate([(u - u**3 / 3 - matrix @ v) / epsilon, b + c * v + matrix.T @ u])


def reduced_rhs(y, links, n, epsilon, b, c):
    """Right-hand side of the node equations, (2 n,)."""
    matrix = incidence(n, links)
    u, w = y[:n], y[n:]
    divergence, laplacian = matrix @ np.ones(len(links)), matrix @ matrix.T
    return np.concatenate([(u - u**3 / 3 - w) / epsilon, b * divergence + c * w + laplacian @ u])


def networked_rhs(state, n, half, sigma, epsilon, b, phi):
    """Right-hand side of the classical ring, oscillator by oscillator, (2 n,)."""
    x, y = state[:n], state[n:]
    bxx, bxy, byx, byy = np.cos(phi), np.sin(phi), -np.sin(phi), np.cos(phi)
    dx, dy = np.zeros(n), np.zeros(n)
    for i in range(n):
        pull_x = pull_y = 0.0
        for j in range(i - half, i + half + 1):
            pull_x += bxx * (x[j % n] - x[i]) + bxy * (y[j % n] - y[i])
            pull_y += byx * (x[j % n] - x[i]) + byy * (y[j % n] - y[i])
        dx[i] = (x[i] - x[i] ** 3 / 3 - y[i] + sigma / (2 * half) * pull_x) / epsilon
        dy[i] = x[i] + b + sigma / (2 * half) * pull_y
    return np.concatenate([dx, dy])


# --- models on networks, with dense matrices ------------------------------------------------------


def dense_boundaries(network):
    """B_1 W^(1/2) and W^(-1/2) B_2, entry by entry."""
    weights = np.ones(len(network.links)) if network.weights is None else network.weights
    b1 = np.zeros((network.n_nodes, len(network.links)))
    for j, (tail, head) in enumerate(network.links):
        b1[tail, j], b1[head, j] = -math.sqrt(weights[j]), math.sqrt(weights[j])
    triangles = () if network.triangles is None else network.triangles
    b2 = np.zeros((len(network.links), len(triangles)))
    for t, (a, b, c) in enumerate(triangles):
        for start, end in ((a, b), (b, c), (c, a)):
            for j, (tail, head) in enumerate(network.links):
                if {tail, head} == {start, end}:
                    b2[j, t] = (1 if tail == start else -1) / math.sqrt(weights[j])
    return b1, b2


def dirac(network, k):
    """D = [B_k^T, B_(k+1)], and how many of its columns belong to B_k^T."""
    b1, b2 = dense_boundaries(network)
    if k == 0:
        return b1, 0
    return (np.hstack([b1.T, b2]), len(b1)) if k == 1 else (b2.T, len(b2))


def dense_adjacency(network):
    """Weight of the link from j to i."""
    weights = np.ones(len(network.links)) if network.weights is None else network.weights
    a = np.zeros((network.n_nodes, network.n_nodes))
    for (tail, head), weight in zip(network.links, weights, strict=True):
        a[head, tail] = weight
        if not network.directed:
            a[tail, head] = weight
    return a


def simplicial_fhn_rhs(state, d, epsilon, b, c):
    """Signals u and all linear signals of the topological model, d = D."""
    u, v = state[: len(d)], state[len(d) :]
    return np.concatenate([(u - u**3 / 3 - d @ v) / epsilon, b + c * v + d.T @ u])


def kuramoto_sakaguchi_rhs(theta, a, coupling, lag, omega):
    """Phases on the nodes of a graph with the weights a."""
    return omega + coupling * (a * np.sin(theta[None, :] - theta[:, None] - lag)).sum(axis=1)


def stuart_landau_rhs(z, a, coupling, lag, growth, omega, shear):
    """Complex oscillators on the nodes of a graph with the weights a."""
    pull = coupling * np.exp(-1j * lag) * (a * (z[None, :] - z[:, None])).sum(axis=1)
    return (growth + 1j * omega) * z - (1 + 1j * shear) * abs(z) ** 2 * z + pull


def network_fhn_rhs(x, y, a, sigma, epsilon, b, phi):
    """Both variables of the networked model on a graph with the weights a."""
    degree = a.sum(axis=1)
    pull_x = (a * (x[None, :] - x[:, None])).sum(axis=1) / degree
    pull_y = (a * (y[None, :] - y[:, None])).sum(axis=1) / degree
    bxx, bxy = math.cos(phi), math.sin(phi)
    dx = (x - x**3 / 3 - y + sigma * (bxx * pull_x + bxy * pull_y)) / epsilon
    return dx, x + b + sigma * (-bxy * pull_x + bxx * pull_y)


def simplicial_kuramoto_rhs(theta, d, lower, coupling, omega, explosive):
    """Phases on simplices; the first ``lower`` columns of d are B_k^T."""
    down, up = d[:, :lower].T @ theta, d[:, lower:].T @ theta
    r_down = abs(np.exp(1j * down).mean()) if explosive else 1.0
    r_up = abs(np.exp(1j * up).mean()) if explosive else 1.0
    pull = r_up * d[:, :lower] @ np.sin(down) + r_down * d[:, lower:] @ np.sin(up)
    return omega - coupling * pull


# --- integrator -----------------------------------------------------------------------------------


def rooted_trees(order):
    """All rooted trees with so many vertices, each a sorted tuple of its branches."""
    if order == 1:
        return [()]
    found = set()
    for sizes in partitions(order - 1):
        for branches in itertools.product(*map(rooted_trees, sizes)):
            found.add(tuple(sorted(branches)))
    return sorted(found)


def partitions(total, largest=None):
    """All ways to write a number as a sum, parts falling."""
    if total == 0:
        yield ()
    for part in range(min(total, largest or total), 0, -1):
        for rest in partitions(total - part, part):
            yield (part, *rest)


def vertices(tree):
    """Number of vertices of a tree: its order."""
    return 1 + sum(map(vertices, tree))


def density(tree):
    """Density of a tree: its order times the densities of its branches."""
    return vertices(tree) * np.prod([density(branch) for branch in tree])


def elementary_weights(tree, a):
    """What each stage of a Runge-Kutta method contributes to the order condition of a tree."""
    weights = np.ones(len(a))
    for branch in tree:
        weights = weights * (a @ elementary_weights(branch, a))
    return weights


def running_sum(terms):
    """Sum from left to right, without an extra zero."""
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def runge_kutta(f, y, method, t_end, times, rtol, atol, max_steps=10**6):
    """One trajectory, step by step as the documentation of the stepping loop says.

    Returns the samples (n, rows), the last state, the numbers of accepted and of tried steps, and
    the time reached.
    """
    t, k = 0.0, [f(y)]
    h = first_step(f, y, k[0], method.order, rtol, atol, t_end)
    log_before, rejected = math.log(1e-4), False
    samples, accepted, tried = [], 0, 0
    while len(samples) < len(times) and times[len(samples)] <= 0.0:
        samples.append(y)
    while t < t_end and tried < max_steps:
        k = k[:1]
        for row in range(1, method.stages):
            y1 = fma(h, weighted_sum(method.a[row, :row], k), y)
            k.append(f(y1))
        error = h * weighted_sum(method.e, k)
        size = np.where(np.abs(y) > np.abs(y1), np.abs(y), np.abs(y1))
        log_error = log_norm(error / fma(rtol, size, atol))
        tried += 1
        if log_error > 0.0:
            h, rejected = h * max(0.2, 0.9 * math.exp(-log_error / method.order)), True
        else:
            t1 = min(t + h, t_end)
            while len(samples) < len(times) and times[len(samples)] <= t1:
                theta = min((times[len(samples)] - t) / h, 1.0)
                weights = np.zeros(method.stages)
                for column in method.p.T[::-1]:
                    weights = fma(weights, theta, column)
                samples.append(fma(h, weighted_sum(weights * theta, k), y))
            bounded = max(log_error, math.log(1e-4))
            factor = 0.9 * math.exp((0.4 * log_before - 0.7 * bounded) / method.order)
            factor = min(10.0, max(0.2, factor))
            h = h * (min(1.0, factor) if rejected else factor)
            log_before, rejected = bounded, False
            t, y, k = t1, y1, [k[-1]]
            accepted += 1
        if t + 1.01 * h >= t_end:
            h = t_end - t
    return np.array(samples), y, accepted, tried, t


@partial(np.vectorize, otypes=[float])
def fma(a, b, c):
    """Multiply and add, rounded once: through whole numbers, whose quotient Python rounds right."""
    (n1, d1), (n2, d2), (n3, d3) = (float(x).as_integer_ratio() for x in (a, b, c))
    return (n1 * n2 * d3 + n3 * d1 * d2) / (d1 * d2 * d3)


def weighted_sum(weights, stages):
    """Sum of the stages, each but the first multiplied and added in one rounding."""
    total = weights[0] * stages[0]
    for weight, stage in zip(weights[1:], stages[1:], strict=True):
        total = fma(weight, stage, total)
    return total


def log_norm(scaled):
    """Logarithm of the root mean square, the squares added in eight sums in turn."""
    sums = [0.0] * 8
    for i, ratio in enumerate(scaled):
        sums[i % 8] = fma(ratio, ratio, sums[i % 8])
    halves = [sums[i] + sums[i + 4] for i in range(4)]
    total = (halves[0] + halves[2]) + (halves[1] + halves[3])
    return 0.5 * math.log(total / len(scaled)) if total > 0.0 else math.log(1e-4)


def first_step(f, y, slope, order, rtol, atol, t_end):
    """Starting step size of Hairer, Norsett, Wanner, section II.4."""
    scale = atol + rtol * np.abs(y)
    d0, d1 = scaled_norm(y / scale), scaled_norm(slope / scale)
    h = min(0.01 * d0 / d1 if d0 >= 1e-5 and d1 >= 1e-5 else 1e-6, t_end)
    change = f(y + h * slope) - slope
    d = max(d1, scaled_norm(change / scale) / h)
    h1 = (0.01 / d) ** (1.0 / (order + 1.0)) if d > 1e-15 else max(1e-6, 1e-3 * h)
    return min(100.0 * h, h1, t_end)


def scaled_norm(ratios):
    """Root mean square, added from left to right."""
    return math.sqrt(running_sum([ratio * ratio for ratio in ratios]) / len(ratios))
