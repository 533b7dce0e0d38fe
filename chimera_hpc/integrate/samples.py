"""Samples between the steps, by the continuous extension of the method (HNW sec. II.6).

Arrays and notation as in `kernel`. Samples are written in whole packs, past the caches: a lane's
samples follow each other, rows of the state within each, up to a whole number of packs.
"""

from __future__ import annotations

from typing import Any

from chimera_hpc.integrate._jit import jit
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
    load,
    splat,
    store,
    stream_at,
    transposed,
)


@jit()
def _weight(p: Any, j: Any, theta: Any) -> Any:
    # Weight of stage j in the continuous extension, sum_d p[j, d] theta**(d + 1).
    weight = splat(0.0)
    for d in range(p.shape[1] - 1, -1, -1):
        weight = (weight + p[j, d]) * theta
    return weight


@jit()
def _between(h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, i: Any) -> Any:
    # Row i of the state at time t + theta h of the step just made, by the continuous extension.
    stages = weights.shape[0]
    total = load(h, weights, 0) * load(h, k, first + i)
    for j in range(1, stages - 1):
        total = total + load(h, weights, j) * load(h, k, j * units + i)
    last = units * (stages - 1) - first
    total = total + load(h, weights, stages - 1) * load(h, k, last + i)
    return load(h, y, i) + h * total


@jit()
def _tile_between(h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, i: Any) -> Any:
    # Rows i ... i + 7 of what `_between` gives, the weights read once for all of them.
    stages = weights.shape[0]
    w = load(h, weights, 0)
    o = first + i
    t0, t1 = w * load(h, k, o), w * load(h, k, o + 1)
    t2, t3 = w * load(h, k, o + 2), w * load(h, k, o + 3)
    t4, t5 = w * load(h, k, o + 4), w * load(h, k, o + 5)
    t6, t7 = w * load(h, k, o + 6), w * load(h, k, o + 7)
    for j in range(1, stages):
        w = load(h, weights, j)
        o = i + (j * units if j < stages - 1 else j * units - first)
        t0, t1 = t0 + w * load(h, k, o), t1 + w * load(h, k, o + 1)
        t2, t3 = t2 + w * load(h, k, o + 2), t3 + w * load(h, k, o + 3)
        t4, t5 = t4 + w * load(h, k, o + 4), t5 + w * load(h, k, o + 5)
        t6, t7 = t6 + w * load(h, k, o + 6), t7 + w * load(h, k, o + 7)
    t0, t1 = load(h, y, i) + h * t0, load(h, y, i + 1) + h * t1
    t2, t3 = load(h, y, i + 2) + h * t2, load(h, y, i + 3) + h * t3
    t4, t5 = load(h, y, i + 4) + h * t4, load(h, y, i + 5) + h * t5
    t6, t7 = load(h, y, i + 6) + h * t6, load(h, y, i + 7) + h * t7
    return t0, t1, t2, t3, t4, t5, t6, t7


@jit()
def _due(lane: Any, count: Any, total: Any, start: Any, step: Any, t_end: Any) -> Any:
    # Find the lanes whose accepted step covers their next sampling time, and where in the step.
    due = 0
    for m in range(lane.shape[1]):
        at = count[NEXT_SAMPLE, m]
        t = min(start + at * step, t_end)
        count[IS_DUE, m] = (
            count[STATE, m] == RUNNING
            and at < total
            and lane[LOG_ERROR_NEW, m] <= 0.0
            and t <= lane[TIME_NEW, m]
        )
        due += count[IS_DUE, m]
        # Lanes that are not due get the state before the step, which nobody reads.
        lane[THETA, m] = 0.0
        if count[IS_DUE, m] == 1:
            lane[THETA, m] = min((t - lane[TIME, m]) / lane[STEP, m], 1.0)
    return due


@jit()
def _keep(samples: Any, count: Any, m: Any, i: Any, values: Any) -> None:
    # Rows i ... i + 7 of lane m's sample, where one is due.
    if count[IS_DUE, m] == 1:
        total, width = samples.shape[1:]
        stream_at(samples, (m * total + count[NEXT_SAMPLE, m]) * width + i, values)


@jit()
def sample(
    like: Any, h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, lane: Any, count: Any,
    p: Any, start: Any, step: Any, t_end: Any, samples: Any,
) -> None:  # fmt: skip
    """Write the observed rows at the sampling times that the accepted steps cover.

    The lanes take their first, second, ... sample of the step together.
    """
    lanes = y.shape[1]
    total, width = samples.shape[1:]
    while _due(lane, count, total, start, step, t_end) > 0:
        theta = across(like, lane, THETA)
        for j in range(weights.shape[0]):
            store(weights, j, _weight(p, j, theta))
        if lanes == 1:
            base = count[NEXT_SAMPLE, 0] * width
            for i in range(width // LANES):
                value = _between(h, y, k, first, units, weights, i)
                stream_at(samples, base + i * LANES, value)
        else:
            for i in range(0, width, LANES):
                s0, s1, s2, s3, s4, s5, s6, s7 = transposed(
                    *_tile_between(h, y, k, first, units, weights, i)
                )
                _keep(samples, count, 0, i, s0)
                _keep(samples, count, 1, i, s1)
                _keep(samples, count, 2, i, s2)
                _keep(samples, count, 3, i, s3)
                _keep(samples, count, 4, i, s4)
                _keep(samples, count, 5, i, s5)
                _keep(samples, count, 6, i, s6)
                _keep(samples, count, 7, i, s7)
        for m in range(lanes):
            count[NEXT_SAMPLE, m] += count[IS_DUE, m]
