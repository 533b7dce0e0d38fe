"""The compiled stepping loop: `LANES` trajectories, or one, in lock step.

Each lane has its own time, step size and outcome; all of them go through the stages together.
Nothing is allocated here and nothing raises: a lane that can't go on gets a status.

Notation of Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (HNW),
secs. II.4 and II.6: ``y`` and ``y1`` are the states before and after the step, ``k`` holds the
stages one after the other, rows ``j * rows ... (j + 1) * rows - 1`` being stage j. The first stage
of a step is the last of the one before; instead of a copy, the two change places (``first``).
Behind the stages is room for the errors of the rows.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from numba.core import types

from chimera_hpc.base.status import Status
from chimera_hpc.integrate.dense_output import sample
from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.lane_rows import (
    ACCEPTED,
    ERROR_SUM,
    FRESH,
    LOG_ERROR,
    LOG_ERROR_NEW,
    REJECTED_LAST,
    RUNNING,
    STATE,
    STEP,
    TIME,
    TIME_NEW,
    TRIED,
)
from chimera_hpc.integrate.simd import LANES, across, splat
from chimera_hpc.integrate.stages import error_sum, last_stage_sum, stage_sum

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
        if count[STATE, m] == FRESH:
            h = lane[STEP, m]
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
        for s in range(1, stages - 1):
            stage_sum(h, y, k, first_unit, units, a, s, y1)
            rhs(y1[:size], k[s * rows : s * rows + size], params, ints)
        last_stage_sum(h, y, k, first_unit, units, a, e, y1)
        rhs(y1[:size], k[last : last + size], params, ints)
        error_sum(zero, h, y, y1, k, first_unit, units, e, rtol, atol, lane)
        rejected = _judge(lane, count, size, t_end)
        sample(
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
    size. ``samples`` (lanes, samples, width) begins on a cache line and ``width`` is a multiple of
    `LANES`; ``weights`` (2 stages, `LANES`) is room for what two samples are made with.
    """
    if lanes not in (1, LANES):
        raise ValueError(f"the stepping loop is compiled for 1 and {LANES} lanes, not {lanes}")
    return jit(_SIGNATURE)(_advance_one if lanes == 1 else _advance_pack)
