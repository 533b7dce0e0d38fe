"""The compiled stepping loop: `LANES` trajectories, or one, in lock step.

Each lane has its own time, step size and outcome; all of them go through the stages together.
Nothing is allocated here and nothing raises: a lane that can't go on gets a status.

Notation of Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (HNW),
secs. II.4 and II.6: ``y`` and ``y1`` are the states before and after the step, ``k`` holds the
stages one after the other, rows ``j * rows ... (j + 1) * rows - 1`` being stage j. The first stage
of a step is the last of the one before; instead of a copy, the two change places (``first``).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from numba.core import types

from chimera_hpc.integrate._jit import jit
from chimera_hpc.integrate.simd import (
    LANES,
    across,
    fold,
    larger,
    load,
    magnitude,
    splat,
    store,
    stream_at,
    transposed,
)
from chimera_hpc.status import Status

# Rows of the lanes' numbers, ``lane`` (LANE_ROWS, lanes).
TIME, STEP, LOG_ERROR, ERROR_SUM, LOG_ERROR_NEW, TIME_NEW, THETA = 0, 1, 2, 3, 4, 5, 6
LANE_ROWS = 7
# Rows of the lanes' counters, ``count`` (COUNT_ROWS, lanes).
STATE, NEXT_SAMPLE, ACCEPTED, TRIED, REJECTED_LAST, IS_DUE = 0, 1, 2, 3, 4, 5
COUNT_ROWS = 6
# Values of the row STATE that are no `Status`: nothing to do, put in anew, on its way.
IDLE, FRESH, RUNNING = -2, -1, 0

# PI control (HNW sec. IV.2): the next step is h * SAFETY * err**(-EXPONENT / order) *
# err_before**(MEMORY / order), the factor kept within [SMALLEST, LARGEST].
SAFETY, SMALLEST, LARGEST, EXPONENT, MEMORY = 0.9, 0.2, 10.0, 0.7, 0.4
LOG_ERROR_FLOOR = math.log(1e-4)

_NON_FINITE = int(Status.NON_FINITE)
_STEP_TOO_SMALL = int(Status.STEP_TOO_SMALL)
_STEP_BUDGET = int(Status.STEP_BUDGET)
_DONE = int(Status.DONE)

_MATRIX = types.Array(types.float64, 2, "C")
_VECTOR = types.Array(types.float64, 1, "C")
RIGHT_HAND_SIDE = types.void(_MATRIX, _MATRIX, _MATRIX, types.Array(types.int64, 1, "C"))
"""Signature of a right-hand side: ``rhs(y, dy, lane_params, int_params)``."""


@jit()
def _stage_sum(h: Any, y: Any, k: Any, first: Any, units: Any, a: Any, s: Any, out: Any) -> None:
    # out = y + h * sum_{j < s} a[s, j] k_j; spelled out up to six terms so that the compiler
    # keeps the weights in registers. The rows go downwards, those of a right-hand side upwards:
    # each finds in the cache what the other has left there.
    o0 = first
    if s == 1:
        a0 = a[s, 0]
        for i in range(units - 1, -1, -1):
            store(out, i, load(h, y, i) + h * (a0 * load(h, k, o0 + i)))
        return
    o1 = units
    if s == 2:
        a0, a1 = a[s, 0], a[s, 1]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i) + a1 * load(h, k, o1 + i)
            store(out, i, load(h, y, i) + h * total)
        return
    o2 = 2 * units
    if s == 3:
        a0, a1, a2 = a[s, 0], a[s, 1], a[s, 2]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i) + a1 * load(h, k, o1 + i)
            total = total + a2 * load(h, k, o2 + i)
            store(out, i, load(h, y, i) + h * total)
        return
    o3 = 3 * units
    if s == 4:
        a0, a1, a2, a3 = a[s, 0], a[s, 1], a[s, 2], a[s, 3]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i) + a1 * load(h, k, o1 + i)
            total = total + a2 * load(h, k, o2 + i) + a3 * load(h, k, o3 + i)
            store(out, i, load(h, y, i) + h * total)
        return
    o4 = 4 * units
    if s == 5:
        a0, a1, a2, a3, a4 = a[s, 0], a[s, 1], a[s, 2], a[s, 3], a[s, 4]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i) + a1 * load(h, k, o1 + i)
            total = total + a2 * load(h, k, o2 + i) + a3 * load(h, k, o3 + i)
            total = total + a4 * load(h, k, o4 + i)
            store(out, i, load(h, y, i) + h * total)
        return
    o5 = 5 * units
    if s == 6:
        a0, a1, a2, a3, a4, a5 = a[s, 0], a[s, 1], a[s, 2], a[s, 3], a[s, 4], a[s, 5]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i) + a1 * load(h, k, o1 + i)
            total = total + a2 * load(h, k, o2 + i) + a3 * load(h, k, o3 + i)
            total = total + a4 * load(h, k, o4 + i) + a5 * load(h, k, o5 + i)
            store(out, i, load(h, y, i) + h * total)
        return
    for i in range(units - 1, -1, -1):
        total = a[s, 0] * load(h, k, o0 + i)
        for j in range(1, s):
            total = total + a[s, j] * load(h, k, j * units + i)
        store(out, i, load(h, y, i) + h * total)


@jit()
def _squared(total: Any, i: Any, context: Any) -> Any:
    h, y, y1, _, _, _, _, rtol, atol = context
    size = larger(magnitude(load(h, y, i)), magnitude(load(h, y1, i)))
    ratio = h * total / (atol + rtol * size)
    return ratio * ratio


@jit()
def _error_of_seven(i: Any, context: Any) -> Any:
    h, _, _, k, first, units, (e0, e1, e2, e3, e4, e5, e6), _, _ = context
    total = e0 * load(h, k, first + i) + e1 * load(h, k, units + i)
    total = total + e2 * load(h, k, 2 * units + i)
    total = total + e3 * load(h, k, 3 * units + i)
    total = total + e4 * load(h, k, 4 * units + i)
    total = total + e5 * load(h, k, 5 * units + i)
    total = total + e6 * load(h, k, 6 * units - first + i)
    return _squared(total, i, context)


@jit()
def _error_of_many(i: Any, context: Any) -> Any:
    h, _, _, k, first, units, e, _, _ = context
    last = e.size - 1
    total = e[0] * load(h, k, first + i)
    for j in range(1, last):
        total = total + e[j] * load(h, k, j * units + i)
    total = total + e[last] * load(h, k, last * units - first + i)
    return _squared(total, i, context)


@jit(inline="always")
def _add_up(zero: Any, term: Any, context: Any, units: Any, lane: Any) -> None:
    # Sum over the rows, HNW eq. II.4.11 without the root: rows go to eight sums in turn, which
    # are then folded in halves. One lane has its eight sums side by side in a pack.
    if lane.shape[1] == 1:
        total = term(0, context)
        for i in range(1, units):
            total = total + term(i, context)
        lane[ERROR_SUM, 0] = fold(total)
        return
    s0, s1, s2, s3, s4, s5, s6, s7 = zero, zero, zero, zero, zero, zero, zero, zero
    whole = units - units % 8
    for i in range(0, whole, 8):
        s0 = s0 + term(i, context)
        s1 = s1 + term(i + 1, context)
        s2 = s2 + term(i + 2, context)
        s3 = s3 + term(i + 3, context)
        s4 = s4 + term(i + 4, context)
        s5 = s5 + term(i + 5, context)
        s6 = s6 + term(i + 6, context)
        s7 = s7 + term(i + 7, context)
    left = units - whole
    s0 = s0 + term(whole, context) if left > 0 else s0
    s1 = s1 + term(whole + 1, context) if left > 1 else s1
    s2 = s2 + term(whole + 2, context) if left > 2 else s2
    s3 = s3 + term(whole + 3, context) if left > 3 else s3
    s4 = s4 + term(whole + 4, context) if left > 4 else s4
    s5 = s5 + term(whole + 5, context) if left > 5 else s5
    s6 = s6 + term(whole + 6, context) if left > 6 else s6
    store(lane, ERROR_SUM, ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7)))


@jit()
def _error_sum(
    zero: Any, h: Any, y: Any, y1: Any, k: Any, first: Any, units: Any, e: Any, rtol: Any,
    atol: Any, lane: Any,
) -> None:  # fmt: skip
    # Sum of (err_i / (atol + rtol max(|y_i|, |y1_i|)))**2 over the rows, HNW eq. II.4.11.
    if e.size == 7:
        e7 = (e[0], e[1], e[2], e[3], e[4], e[5], e[6])
        _add_up(zero, _error_of_seven, (h, y, y1, k, first, units, e7, rtol, atol), units, lane)
    else:
        _add_up(zero, _error_of_many, (h, y, y1, k, first, units, e, rtol, atol), units, lane)


@jit()
def _scaled_norm(
    a: Any, b: Any, weight: Any, y: Any, a0: Any, b0: Any, m: Any, size: Any, rtol: Any,
    atol: Any,
) -> Any:  # fmt: skip
    # Norm of a - weight * b in the error scale of y, in lane m; a, b start at rows a0, b0.
    total = 0.0
    for i in range(size):
        ratio = (a[a0 + i, m] - weight * b[b0 + i, m]) / (atol + rtol * abs(y[i, m]))
        total += ratio * ratio
    return math.sqrt(total / size)


@jit()
def _start(
    rhs: Any, params: Any, ints: Any, y: Any, y1: Any, k: Any, first: Any, lane: Any, count: Any,
    size: Any, order: Any, rtol: Any, atol: Any, t_end: Any,
) -> None:  # fmt: skip
    # First derivative and first step size of the lanes just put in, HNW sec. II.4 ("Starting
    # step size"); the rows of the other lanes are not touched.
    rows, lanes = y.shape
    s1, s2 = rows, 2 * rows
    rhs(y[:size], k[s1 : s1 + size], params, ints)
    for m in range(lanes):
        if count[STATE, m] == FRESH:
            for i in range(size):
                k[first + i, m] = k[s1 + i, m]
            d0 = _scaled_norm(y, y, 0.0, y, 0, 0, m, size, rtol, atol)
            d1 = _scaled_norm(k, y, 0.0, y, first, 0, m, size, rtol, atol)
            h = 1e-6
            if d0 >= 1e-5 and d1 >= 1e-5:
                h = 0.01 * d0 / d1
            lane[STEP, m] = min(h, t_end)
    for m in range(lanes):
        h = lane[STEP, m] if count[STATE, m] == FRESH else 0.0
        for i in range(size):
            y1[i, m] = y[i, m] + h * k[s1 + i, m]
    rhs(y1[:size], k[s2 : s2 + size], params, ints)
    for m in range(lanes):
        if count[STATE, m] == FRESH:
            h = lane[STEP, m]
            d1 = _scaled_norm(k, y, 0.0, y, first, 0, m, size, rtol, atol)
            d2 = _scaled_norm(k, k, 1.0, y, s2, s1, m, size, rtol, atol) / h
            d = max(d1, d2)
            h1 = max(1e-6, h * 1e-3)
            if d > 1e-15:
                h1 = (0.01 / d) ** (1.0 / (order + 1.0))
            h = min(100.0 * h, h1, t_end)
            if not (h > 0.0):
                h = 1e-6
            lane[STEP, m] = h
            count[STATE, m] = RUNNING


@jit()
def _judge(lane: Any, count: Any, size: Any, t_end: Any) -> Any:
    # Accept or reject the step of each running lane; returns the number of lanes rejected.
    rejected = 0
    for m in range(lane.shape[1]):
        if count[STATE, m] != RUNNING:
            continue
        count[TRIED, m] += 1
        error_sum = lane[ERROR_SUM, m]
        log_error = LOG_ERROR_FLOOR
        if not math.isfinite(error_sum):
            log_error = math.inf
        elif error_sum > 0.0:
            log_error = 0.5 * math.log(error_sum / size)
        lane[LOG_ERROR_NEW, m] = log_error
        lane[TIME_NEW, m] = lane[TIME, m]
        if log_error <= 0.0:
            t_new = lane[TIME, m] + lane[STEP, m]
            lane[TIME_NEW, m] = min(t_new, t_end)
        else:
            rejected += 1
    return rejected


@jit()
def _weight(p: Any, j: Any, theta: Any) -> Any:
    # Weight of stage j in the continuous extension, sum_d p[j, d] theta**(d + 1).
    weight = splat(0.0)
    for d in range(p.shape[1] - 1, -1, -1):
        weight = (weight + p[j, d]) * theta
    return weight


@jit()
def _between(
    h: Any, y: Any, k: Any, first: Any, units: Any, stages: Any, weights: Any, i: Any
) -> Any:
    # Row i of the state at time t + theta h of the step just made, by the continuous extension.
    total = load(h, weights, 0) * load(h, k, first + i)
    for j in range(1, stages - 1):
        total = total + load(h, weights, j) * load(h, k, j * units + i)
    last = units * (stages - 1) - first
    total = total + load(h, weights, stages - 1) * load(h, k, last + i)
    return load(h, y, i) + h * total


@jit()
def _tile_between(
    h: Any, y: Any, k: Any, first: Any, units: Any, stages: Any, weights: Any, i: Any
) -> Any:
    # Rows i ... i + 7 of what `_between` gives, the weights read once for all of them.
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
def _sample(
    like: Any, h: Any, y: Any, k: Any, first: Any, units: Any, weights: Any, lane: Any, count: Any,
    p: Any, start: Any, step: Any, t_end: Any, samples: Any,
) -> None:  # fmt: skip
    # Values of the observed rows at the sampling times that the accepted steps cover; the lanes
    # take their first, second, ... sample of the step together.
    lanes = y.shape[1]
    total, width = samples.shape[1:]
    stages = p.shape[0]
    while _due(lane, count, total, start, step, t_end) > 0:
        theta = across(like, lane, THETA)
        for j in range(stages):
            store(weights, j, _weight(p, j, theta))
        if lanes == 1:
            base = count[NEXT_SAMPLE, 0] * width
            for i in range(width // LANES):
                value = _between(h, y, k, first, units, stages, weights, i)
                stream_at(samples, base + i * LANES, value)
        else:
            for i in range(0, width, LANES):
                s0, s1, s2, s3, s4, s5, s6, s7 = transposed(
                    *_tile_between(h, y, k, first, units, stages, weights, i)
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


@jit()
def _next_step(lane: Any, count: Any, m: Any, order: Any, t_end: Any, max_steps: Any) -> None:
    # Move lane m on and choose its next step size, or end it.
    log_error = lane[LOG_ERROR_NEW, m]
    if log_error <= 0.0:
        bounded = max(log_error, LOG_ERROR_FLOOR)
        factor = SAFETY * math.exp((MEMORY * lane[LOG_ERROR, m] - EXPONENT * bounded) / order)
        factor = min(LARGEST, max(SMALLEST, factor))
        if count[REJECTED_LAST, m] == 1:
            factor = min(1.0, factor)
        lane[LOG_ERROR, m] = bounded
        count[REJECTED_LAST, m] = 0
        count[ACCEPTED, m] += 1
        lane[TIME, m] = lane[TIME_NEW, m]
        if lane[TIME, m] >= t_end:
            count[STATE, m] = _DONE
    else:
        factor = max(SMALLEST, SAFETY * math.exp(-log_error / order))
        count[REJECTED_LAST, m] = 1
    t = lane[TIME, m]
    h = lane[STEP, m] * factor
    if count[STATE, m] == RUNNING:
        if h <= 1e-14 * max(abs(t), 1e-3):
            count[STATE, m] = _STEP_TOO_SMALL if math.isfinite(log_error) else _NON_FINITE
        elif count[TRIED, m] >= max_steps:
            count[STATE, m] = _STEP_BUDGET
    # A step that would end just short of t_end is stretched to it: no sliver is left over.
    if t + 1.01 * h >= t_end:
        h = t_end - t
    lane[STEP, m] = h if count[STATE, m] == RUNNING else 0.0


@jit()
def _advance(
    like: Any, rhs: Any, params: Any, ints: Any, y: Any, y1: Any, k: Any, weights: Any, lane: Any,
    count: Any, size: Any, a: Any, e: Any, p: Any, order: Any, rtol: Any, atol: Any, t_end: Any,
    max_steps: Any, start: Any, step: Any, samples: Any, iterations: Any,
) -> Any:  # fmt: skip
    rows, lanes = y.shape
    units = rows // LANES if lanes == 1 else rows
    zero = splat(0.0)
    stages = e.size
    first = 0
    n_fresh = 0
    n_running = 0
    for m in range(lanes):
        n_fresh += count[STATE, m] == FRESH
        n_running += count[STATE, m] == RUNNING
    if n_fresh > 0:
        _start(rhs, params, ints, y, y1, k, first, lane, count, size, order, rtol, atol, t_end)
        n_running += n_fresh
    done = 0
    swapped = False
    still = n_running
    while done < iterations and still == n_running:
        h = across(like, lane, STEP)
        last = rows * (stages - 1) - first
        first_unit = first * units // rows
        for s in range(1, stages):
            _stage_sum(h, y, k, first_unit, units, a, s, y1)
            o = last if s == stages - 1 else s * rows
            rhs(y1[:size], k[o : o + size], params, ints)
        _error_sum(zero, h, y, y1, k, first_unit, units, e, rtol, atol, lane)
        rejected = _judge(lane, count, size, t_end)
        _sample(
            like, h, y, k, first_unit, units, weights, lane, count, p, start, step, t_end,
            samples,
        )  # fmt: skip
        if rejected > 0:
            for m in range(lanes):
                if count[STATE, m] == RUNNING and lane[LOG_ERROR_NEW, m] > 0.0:
                    for i in range(size):
                        y1[i, m] = y[i, m]
                        k[last + i, m] = k[first + i, m]
        still = 0
        for m in range(lanes):
            if count[STATE, m] == RUNNING:
                _next_step(lane, count, m, order, t_end, max_steps)
                still += count[STATE, m] == RUNNING
        y, y1 = y1, y
        swapped = not swapped
        first = last
        done += 1
    # Hand the state back where it came from.
    if swapped:
        for i in range(rows):
            for m in range(lanes):
                y1[i, m] = y[i, m]
    if first != 0:
        for i in range(rows):
            for m in range(lanes):
                k[i, m] = k[first + i, m]
    return done


_SIGNATURE = types.int64(
    types.FunctionType(RIGHT_HAND_SIDE),
    *(_MATRIX, types.Array(types.int64, 1, "C")),
    *(_MATRIX, _MATRIX, _MATRIX, _MATRIX),
    *(_MATRIX, types.Array(types.int64, 2, "C"), types.int64),
    *(_MATRIX, _VECTOR, _MATRIX),
    *(types.float64, types.float64, types.float64, types.float64, types.int64),
    *(types.float64, types.float64, types.Array(types.float64, 3, "C"), types.int64),
)


def _advance_one(  # type: ignore[no-untyped-def]
    rhs, params, ints, y, y1, k, weights, lane, count, size, a, e, p, order, rtol, atol, t_end,
    max_steps, start, step, samples, iterations,
):  # fmt: skip
    return _advance(
        0.0, rhs, params, ints, y, y1, k, weights, lane, count, size, a, e, p, order, rtol, atol,
        t_end, max_steps, start, step, samples, iterations,
    )  # fmt: skip


def _advance_pack(  # type: ignore[no-untyped-def]
    rhs, params, ints, y, y1, k, weights, lane, count, size, a, e, p, order, rtol, atol, t_end,
    max_steps, start, step, samples, iterations,
):  # fmt: skip
    return _advance(
        splat(0.0), rhs, params, ints, y, y1, k, weights, lane, count, size, a, e, p, order, rtol,
        atol, t_end, max_steps, start, step, samples, iterations,
    )  # fmt: skip


@cache
def advance(lanes: int) -> Any:
    """Stepping loop for one lane or for `LANES` lanes; compiled, or read from disk, at first use.

    ``advance(lanes)(rhs, lane_params, int_params, y, y1, k, weights, lane, count, size, a, e, p,
    order, rtol, atol, t_end, max_steps, start, step, samples, iterations)`` tries at
    most ``iterations`` steps in every running lane and comes back as soon as a lane has ended; it
    returns how many it tried. Lanes marked `FRESH` are started first: first derivative, first step
    size.
    """
    if lanes not in (1, LANES):
        raise ValueError(f"the stepping loop is compiled for 1 and {LANES} lanes, not {lanes}")
    return jit(_SIGNATURE)(_advance_one if lanes == 1 else _advance_pack)
