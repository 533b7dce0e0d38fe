"""Samples between the steps, by the continuous extension of the method (HNW sec. II.6).

Arrays and notation as in `stepper` and `arguments`. Samples are written in whole vectors and bypass
the caches. The samples of a lane are contiguous. Each sample holds the observed rows of the state,
padded to a whole number of vectors.
"""

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.lane_rows import (
    IS_DUE,
    LOG_ERROR_NEW,
    NEXT_SAMPLE,
    RUNNING,
    STATE,
    STEP,
    THETA,
    TIME,
    TIME_NEW,
)
from chimera_hpc.integrate.simd import (
    LANES,
    across,
    broadcast,
    fma,
    load,
    store,
    stream_at,
    transposed,
)


@jit()
def _weight(p, j, theta):
    # Weight of stage j in the continuous extension, sum_d p[j, d] theta**(d + 1).
    weight = broadcast(0.0)
    for d in range(p.shape[1] - 1, -1, -1):
        weight = fma(weight, theta, p[j, d])
    return weight * theta


@jit()
def _between(h, step, weights, i):
    # Row i of the state at time t + theta h of the current step, by the continuous extension.
    stages = weights.shape[0]
    total = load(h, weights, 0) * load(h, step.k, step.first + i)
    for j in range(1, stages - 1):
        total = fma(load(h, weights, j), load(h, step.k, j * step.units + i), total)
    last = step.units * (stages - 1) - step.first
    total = fma(load(h, weights, stages - 1), load(h, step.k, last + i), total)
    return fma(h, total, load(h, step.y, i))


@jit()
def _four(h, rows, i):
    return load(h, rows, i), load(h, rows, i + 1), load(h, rows, i + 2), load(h, rows, i + 3)


@jit()
def _eight(h, rows, i):
    return _four(h, rows, i) + _four(h, rows, i + 4)


@jit()
def _eight_of(j, h, step, stages, i):
    # Rows i ... i + 7 of stage j; the first and the last stage may be swapped.
    if j == 0:
        return _eight(h, step.k, step.first + i)
    return _eight(h, step.k, j * step.units + i - (step.first if j == stages - 1 else 0))


@jit()
def _times(w, a):
    return w * a[0], w * a[1], w * a[2], w * a[3], w * a[4], w * a[5], w * a[6], w * a[7]


@jit()
def _fma_each(w, a, b):
    v0, v1, v2, v3 = fma(w, a[0], b[0]), fma(w, a[1], b[1]), fma(w, a[2], b[2]), fma(w, a[3], b[3])
    v4, v5, v6, v7 = fma(w, a[4], b[4]), fma(w, a[5], b[5]), fma(w, a[6], b[6]), fma(w, a[7], b[7])
    return v0, v1, v2, v3, v4, v5, v6, v7


@jit()
def _tile(h, step, weights, i):
    # Rows i ... i + 7 of `_between`; the weights are read once for all of them.
    stages = weights.shape[0]
    tile = _times(load(h, weights, 0), _eight_of(0, h, step, stages, i))
    for j in range(1, stages):
        tile = _fma_each(load(h, weights, j), _eight_of(j, h, step, stages, i), tile)
    return _fma_each(h, tile, _eight(h, step.y, i))


@jit()
def _due(lanes, limits):
    # Find the lanes whose accepted step covers their next sampling time, and where in the step.
    lane, count, due = lanes.lane, lanes.counters, 0
    for m in range(lane.shape[1]):
        at = count[NEXT_SAMPLE, m]
        t = min(limits.start + at * limits.step, limits.t_end)
        count[IS_DUE, m] = (
            count[STATE, m] == RUNNING
            and at < lanes.samples.shape[1]
            and lane[LOG_ERROR_NEW, m] <= 0.0
            and t <= lane[TIME_NEW, m]
        )
        due += count[IS_DUE, m]
        # Lanes without a due sample get the state before the step, which is not read.
        lane[THETA, m] = 0.0
        if count[IS_DUE, m] == 1:
            lane[THETA, m] = min((t - lane[TIME, m]) / lane[STEP, m], 1.0)
    return due


@jit()
def _weigh(like, lanes, p):
    theta = across(like, lanes.lane, THETA)
    for j in range(p.shape[0]):
        store(lanes.weights, j, _weight(p, j, theta))


@jit()
def _keep(samples, count, m, i, vector):
    # Rows i ... i + 7 of lane m's sample, if one is due. This function is called often and not
    # inlined, so it takes the two arrays that it uses instead of all of `Lanes`.
    if count[IS_DUE, m] == 1:
        total, width = samples.shape[1:]
        stream_at(samples, (m * total + count[NEXT_SAMPLE, m]) * width + i, vector)


@jit()
def _keep_tile(samples, count, i, tile):
    s0, s1, s2, s3, s4, s5, s6, s7 = transposed(tile)
    _keep(samples, count, 0, i, s0)
    _keep(samples, count, 1, i, s1)
    _keep(samples, count, 2, i, s2)
    _keep(samples, count, 3, i, s3)
    _keep(samples, count, 4, i, s4)
    _keep(samples, count, 5, i, s5)
    _keep(samples, count, 6, i, s6)
    _keep(samples, count, 7, i, s7)


@jit()
def sample(like, h, step, lanes, p, limits):
    """Write the observed rows at the sampling times that the accepted steps cover."""
    count, weights, samples = lanes.counters, lanes.weights, lanes.samples
    width = samples.shape[2]
    while _due(lanes, limits) > 0:
        _weigh(like, lanes, p)
        if count.shape[1] == 1:
            base = count[NEXT_SAMPLE, 0] * width
            for i in range(width // LANES):
                stream_at(samples, base + i * LANES, _between(h, step, weights, i))
        else:
            for i in range(0, width, LANES):
                _keep_tile(samples, count, i, _tile(h, step, weights, i))
        for m in range(count.shape[1]):
            count[NEXT_SAMPLE, m] += count[IS_DUE, m]
