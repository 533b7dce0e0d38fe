"""The compiled stepping loop: `LANES` trajectories, or one, in lock step.

Each lane has its own time, step size and status. All lanes compute a stage together. The loop
allocates no memory and raises no exception: a lane that fails gets a status.

Notation of Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (HNW),
secs. II.4 and II.6: ``y`` and ``y1`` are the states before and after the step, ``k`` holds the
stages in order: rows ``j * rows ... (j + 1) * rows - 1`` are stage j. The first stage of a step is
the last of the previous one. The two are swapped by the offset ``first`` instead of a copy. The
errors of the rows are stored after the stages. See `arguments` for the arguments.
"""

import math
from functools import cache

from numba import types

from chimera_hpc.base.status import Status
from chimera_hpc.integrate.arguments import Lanes, Limits, Method, Step
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
from chimera_hpc.integrate.simd import LANES, across, broadcast
from chimera_hpc.integrate.stages import error_sum, last_stage_sum, stage_sum

# PI control (HNW sec. IV.2): the next step is h * SAFETY * err**(-EXPONENT / order) *
# err_before**(MEMORY / order), with the factor clipped to [SMALLEST, LARGEST].
SAFETY, SMALLEST, LARGEST, EXPONENT, MEMORY = 0.9, 0.2, 10.0, 0.7, 0.4
LOG_ERROR_FLOOR = math.log(1e-4)

_NON_FINITE = int(Status.NON_FINITE)
_STEP_TOO_SMALL = int(Status.STEP_TOO_SMALL)
_STEP_BUDGET = int(Status.STEP_BUDGET)
_DONE = int(Status.DONE)

_MATRIX = types.Array(types.float64, 2, "C")
_VECTOR = types.Array(types.float64, 1, "C")
_INTEGERS = types.Array(types.int64, 1, "C")
RIGHT_HAND_SIDE = types.void(_MATRIX, _MATRIX, _MATRIX, _INTEGERS)
"""Signature of a right-hand side: ``rhs(y, dy, lane_params, int_params)``."""


@jit()
def _scaled_norm(rows, first, y, m, size, limits):
    # Norm of ``size`` rows from ``first`` on in the error scale of y, in lane m.
    total = 0.0
    for i in range(size):
        ratio = rows[first + i, m] / (limits.atol + limits.rtol * abs(y[i, m]))
        total += ratio * ratio
    return math.sqrt(total / size)


@jit()
def _start(rhs, inputs, lanes, limits, order):
    # First derivative and first step size of new lanes, HNW sec. II.4 ("Starting step size"). The
    # rows of other lanes do not change.
    params, ints, size = inputs
    y, y1, k, lane, count = lanes.y, lanes.y1, lanes.k, lanes.lane, lanes.counters
    rows, n_lanes = y.shape
    s1, s2 = rows, 2 * rows
    rhs(y[:size], k[s1 : s1 + size], params, ints)
    for m in range(n_lanes):
        if count[STATE, m] == FRESH:
            d0 = _scaled_norm(y, 0, y, m, size, limits)
            d1 = _scaled_norm(k, s1, y, m, size, limits)
            h = 1e-6
            if d0 >= 1e-5 and d1 >= 1e-5:
                h = 0.01 * d0 / d1
            lane[STEP, m] = h = min(h, limits.t_end)
            for i in range(size):
                k[i, m] = k[s1 + i, m]
                y1[i, m] = y[i, m] + h * k[s1 + i, m]
    rhs(y1[:size], k[s2 : s2 + size], params, ints)
    for m in range(n_lanes):
        if count[STATE, m] == FRESH:
            for i in range(size):
                y1[i, m] = k[s2 + i, m] - k[i, m]
            h = lane[STEP, m]
            d1 = _scaled_norm(k, 0, y, m, size, limits)
            d2 = _scaled_norm(y1, 0, y, m, size, limits) / h
            d = max(d1, d2)
            h1 = max(1e-6, h * 1e-3)
            if d > 1e-15:
                h1 = (0.01 / d) ** (1.0 / (order + 1.0))
            h = min(100.0 * h, h1, limits.t_end)
            if not (h > 0.0):
                h = 1e-6
            lane[STEP, m] = h
            count[STATE, m] = RUNNING


@jit()
def _judge(lane, count, size, t_end):
    # Accept or reject the step of each running lane. Returns the number of rejected lanes.
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
def _next_step(lane, count, m, order, limits):
    # Advance lane m and choose its next step size, or end it.
    t_end = limits.t_end
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
        elif count[TRIED, m] >= limits.max_steps:
            count[STATE, m] = _STEP_BUDGET
    # A step that would end just before t_end is extended to it, to avoid a tiny last step.
    if t + 1.01 * h >= t_end:
        h = t_end - t
    lane[STEP, m] = h if count[STATE, m] == RUNNING else 0.0


@jit()
def _undo(y, y1, k, first, last, m, size):
    # Undo the rejected step of lane m: reset the state and slope to those before the step.
    for i in range(size):
        y1[i, m] = y[i, m]
        k[last + i, m] = k[first + i, m]


@jit()
def _copy(source, first, target):
    # Copy rows of ``source`` from ``first`` on into ``target``, as many as ``target`` has.
    for i in range(target.shape[0]):
        for m in range(target.shape[1]):
            target[i, m] = source[first + i, m]


@jit()
def _advance(like, rhs, inputs, lanes, method, limits, iterations):
    params, ints, size = inputs
    y, y1, k, lane, count = lanes.y, lanes.y1, lanes.k, lanes.lane, lanes.counters
    a, e, order = method.a, method.e, method.order
    rows, n_lanes = y.shape
    units = rows // LANES if n_lanes == 1 else rows
    zero = broadcast(0.0)
    stages = e.size
    first = 0
    n_fresh = 0
    n_running = 0
    for m in range(n_lanes):
        n_fresh += count[STATE, m] == FRESH
        n_running += count[STATE, m] == RUNNING
    if n_fresh > 0:
        _start(rhs, inputs, lanes, limits, order)
        n_running += n_fresh
    # What the right-hand side gets of y and y1: made once, as a new view takes time.
    state, state1 = y[:size], y1[:size]
    done = 0
    swapped = False
    still_running = n_running
    while done < iterations and still_running == n_running:
        h = across(like, lane, STEP)
        last = rows * (stages - 1) - first
        step = Step(y, y1, k, first * units // rows, units)
        for s in range(1, stages - 1):
            stage_sum(h, step, a, s)
            rhs(state1, k[s * rows : s * rows + size], params, ints)
        last_stage_sum(h, step, a, e)
        rhs(state1, k[last : last + size], params, ints)
        error_sum(zero, h, step, e, limits, lane)
        rejected = _judge(lane, count, size, limits.t_end)
        sample(like, h, step, lanes, method.p, limits)
        if rejected > 0:
            for m in range(n_lanes):
                if count[STATE, m] == RUNNING and lane[LOG_ERROR_NEW, m] > 0.0:
                    _undo(y, y1, k, first, last, m, size)
        still_running = 0
        for m in range(n_lanes):
            if count[STATE, m] == RUNNING:
                _next_step(lane, count, m, order, limits)
                still_running += count[STATE, m] == RUNNING
        y, y1, state, state1 = y1, y, state1, state
        swapped = not swapped
        first = last
        done += 1
    # The caller expects the state in its own arrays.
    if swapped:
        _copy(y, 0, y1)
    if first != 0:
        _copy(k, first, k[:rows])
    return done


_REAL = types.float64
_COUNT, _SAMPLES = types.Array(types.int64, 2, "C"), types.Array(_REAL, 3, "C")
_LANES = types.NamedTuple((_MATRIX, _MATRIX, _MATRIX, _MATRIX, _MATRIX, _COUNT, _SAMPLES), Lanes)
_METHOD = types.NamedTuple((_MATRIX, _VECTOR, _MATRIX, _REAL), Method)
_LIMITS = types.NamedTuple((_REAL, _REAL, _REAL, types.int64, _REAL, _REAL), Limits)
_SIGNATURE = types.int64(
    types.FunctionType(RIGHT_HAND_SIDE),
    _MATRIX,
    _INTEGERS,
    _LANES,
    _METHOD,
    _LIMITS,
    types.int64,
    types.int64,
)


def _advance_one(rhs, params, ints, lanes, method, limits, size, iterations):
    return _advance(0.0, rhs, (params, ints, size), lanes, method, limits, iterations)


def _advance_vector(rhs, params, ints, lanes, method, limits, size, iterations):
    like = broadcast(0.0)
    return _advance(like, rhs, (params, ints, size), lanes, method, limits, iterations)


@cache
def advance(lanes):
    """Return the stepping loop for 1 or `LANES` lanes, compiled or read from disk at first use.

    ``advance(n)(rhs, params, ints, lanes, method, limits, size, iterations)`` tries at most
    ``iterations`` steps in every running lane. It returns the number of tried steps as soon as a
    lane has ended. For `FRESH` lanes, it first computes the first derivative and step size.
    ``size`` is the number of rows of the state that the right-hand side gets.
    """
    if lanes not in (1, LANES):
        raise ValueError(f"the stepping loop is compiled for 1 and {LANES} lanes, not {lanes}")
    return jit(_SIGNATURE)(_advance_one if lanes == 1 else _advance_vector)
