"""Samples between the steps, by the continuous extension of the method (HNW sec. II.6).

Arrays and notation as in `kernel`. Samples are written in whole packs, past the caches: a lane's
samples follow each other, rows of the state within each, up to a whole number of packs.
"""

from __future__ import annotations

from typing import Any

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.lane_rows import (
    IS_DUE,
    IS_DUE_AFTER,
    LOG_ERROR_NEW,
    NEXT_SAMPLE,
    RUNNING,
    STATE,
    STEP,
    THETA,
    THETA_AFTER,
    TIME,
    TIME_NEW,
)
from chimera_hpc.integrate.simd import (
    LANES,
    across,
    fma,
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
        weight = fma(weight, theta, p[j, d])
    return weight * theta


@jit()
def _between(h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, i: Any) -> Any:
    # Row i of the state at time t + theta h of the step just made, by the continuous extension.
    stages = weights.shape[0] // 2
    total = load(h, weights, 0) * load(h, k, first + i)
    for j in range(1, stages - 1):
        total = fma(load(h, weights, j), load(h, k, j * units + i), total)
    last = units * (stages - 1) - first
    total = fma(load(h, weights, stages - 1), load(h, k, last + i), total)
    return fma(h, total, load(h, y, i))


@jit()
def _eight(h: Any, rows: Any, i: Any) -> Any:
    return (
        *(load(h, rows, i), load(h, rows, i + 1), load(h, rows, i + 2), load(h, rows, i + 3)),
        *(load(h, rows, i + 4), load(h, rows, i + 5), load(h, rows, i + 6), load(h, rows, i + 7)),
    )


@jit()
def _eight_of(j: Any, h: Any, k: Any, first: Any, units: Any, stages: Any, i: Any) -> Any:
    # Rows i ... i + 7 of stage j; the first stage and the last may have changed places.
    if j == 0:
        return _eight(h, k, first + i)
    return _eight(h, k, j * units + i - (first if j == stages - 1 else 0))


@jit()
def _times(w: Any, a: Any) -> Any:
    return w * a[0], w * a[1], w * a[2], w * a[3], w * a[4], w * a[5], w * a[6], w * a[7]


@jit()
def _fma_each(w: Any, a: Any, b: Any) -> Any:
    return (
        *(fma(w, a[0], b[0]), fma(w, a[1], b[1]), fma(w, a[2], b[2]), fma(w, a[3], b[3])),
        *(fma(w, a[4], b[4]), fma(w, a[5], b[5]), fma(w, a[6], b[6]), fma(w, a[7], b[7])),
    )


@jit()
def _tile(h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, i: Any) -> Any:
    # Rows i ... i + 7 of what `_between` gives, the weights read once for all of them.
    stages = weights.shape[0] // 2
    tile = _times(load(h, weights, 0), _eight_of(0, h, k, first, units, stages, i))
    for j in range(1, stages):
        rows = _eight_of(j, h, k, first, units, stages, i)
        tile = _fma_each(load(h, weights, j), rows, tile)
    return _fma_each(h, tile, _eight(h, y, i))


@jit()
def _two_tiles(h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, i: Any) -> Any:
    # The same for two samples, the stages read once for both.
    stages = weights.shape[0] // 2
    rows = _eight_of(0, h, k, first, units, stages, i)
    tile, after = _times(load(h, weights, 0), rows), _times(load(h, weights, stages), rows)
    for j in range(1, stages):
        rows = _eight_of(j, h, k, first, units, stages, i)
        tile = _fma_each(load(h, weights, j), rows, tile)
        after = _fma_each(load(h, weights, stages + j), rows, after)
    rows = _eight(h, y, i)
    return _fma_each(h, tile, rows), _fma_each(h, after, rows)


@jit()
def _due(
    lane: Any, count: Any, after: Any, is_due: Any, theta: Any, total: Any, start: Any, step: Any,
    t_end: Any,
) -> Any:  # fmt: skip
    # Find the lanes whose accepted step covers their next sampling time, or the one ``after`` it,
    # and where in the step.
    due = 0
    for m in range(lane.shape[1]):
        at = count[NEXT_SAMPLE, m] + after
        t = min(start + at * step, t_end)
        count[is_due, m] = (
            count[STATE, m] == RUNNING
            and at < total
            and lane[LOG_ERROR_NEW, m] <= 0.0
            and t <= lane[TIME_NEW, m]
        )
        due += count[is_due, m]
        # Lanes that are not due get the state before the step, which nobody reads.
        lane[theta, m] = 0.0
        if count[is_due, m] == 1:
            lane[theta, m] = min((t - lane[TIME, m]) / lane[STEP, m], 1.0)
    return due


@jit()
def _weigh(like: Any, lane: Any, row: Any, p: Any, weights: Any, first: Any) -> None:
    theta = across(like, lane, row)
    for j in range(p.shape[0]):
        store(weights, first + j, _weight(p, j, theta))


@jit()
def _keep(samples: Any, count: Any, is_due: Any, at: Any, m: Any, i: Any, values: Any) -> None:
    # Rows i ... i + 7 of lane m's sample, where one is due.
    if count[is_due, m] == 1:
        total, width = samples.shape[1:]
        stream_at(samples, (m * total + count[NEXT_SAMPLE, m] + at) * width + i, values)


@jit()
def _keep_tile(samples: Any, count: Any, is_due: Any, at: Any, i: Any, tile: Any) -> None:
    s0, s1, s2, s3, s4, s5, s6, s7 = transposed(*tile)
    _keep(samples, count, is_due, at, 0, i, s0)
    _keep(samples, count, is_due, at, 1, i, s1)
    _keep(samples, count, is_due, at, 2, i, s2)
    _keep(samples, count, is_due, at, 3, i, s3)
    _keep(samples, count, is_due, at, 4, i, s4)
    _keep(samples, count, is_due, at, 5, i, s5)
    _keep(samples, count, is_due, at, 6, i, s6)
    _keep(samples, count, is_due, at, 7, i, s7)


@jit()
def sample(
    like: Any, h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, lane: Any, count: Any,
    p: Any, start: Any, step: Any, t_end: Any, samples: Any,
) -> None:  # fmt: skip
    """Write the observed rows at the sampling times that the accepted steps cover.

    The lanes take their first two, second two, ... samples of the step together.
    """
    lanes = y.shape[1]
    total, width = samples.shape[1:]
    while _due(lane, count, 0, IS_DUE, THETA, total, start, step, t_end) > 0:
        _weigh(like, lane, THETA, p, weights, 0)
        if lanes == 1:
            base = count[NEXT_SAMPLE, 0] * width
            for i in range(width // LANES):
                value = _between(h, y, k, first, units, weights, i)
                stream_at(samples, base + i * LANES, value)
        elif _due(lane, count, 1, IS_DUE_AFTER, THETA_AFTER, total, start, step, t_end) > 0:
            _weigh(like, lane, THETA_AFTER, p, weights, p.shape[0])
            for i in range(0, width, LANES):
                tile, after = _two_tiles(h, y, k, first, units, weights, i)
                _keep_tile(samples, count, IS_DUE, 0, i, tile)
                _keep_tile(samples, count, IS_DUE_AFTER, 1, i, after)
        else:
            for i in range(0, width, LANES):
                tile = _tile(h, y, k, first, units, weights, i)
                _keep_tile(samples, count, IS_DUE, 0, i, tile)
        for m in range(lanes):
            count[NEXT_SAMPLE, m] += count[IS_DUE, m] + count[IS_DUE_AFTER, m]
