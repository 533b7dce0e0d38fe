"""Weighted sums over the stages of a step: the state of the next stage, the error of the step.

Arrays and notation as in `stepper` and `arguments`. A sum processes one unit at a time: a row of
eight lanes, or eight rows of one lane.
"""

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.lane_rows import ERROR_SUM
from chimera_hpc.integrate.simd import broadcast, fma, fold, larger, load, magnitude, store


@jit()
def stage_sum(h, step, a, s):
    """Write ``y1 = y + h * sum_{j < s} a[s, j] k_j``, the state at which stage s is the slope."""
    # Written out up to six terms so that the compiler keeps the weights in registers. This loop
    # goes down the rows and a right-hand side goes up, so each starts with rows that are cached.
    y, out, k, first, units = step
    o0 = first
    if s == 1:
        a0 = a[s, 0]
        for i in range(units - 1, -1, -1):
            store(out, i, fma(h, a0 * load(h, k, o0 + i), load(h, y, i)))
        return
    o1 = units
    if s == 2:
        a0, a1 = a[s, 0], a[s, 1]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i)
            total = fma(a1, load(h, k, o1 + i), total)
            store(out, i, fma(h, total, load(h, y, i)))
        return
    o2 = 2 * units
    if s == 3:
        a0, a1, a2 = a[s, 0], a[s, 1], a[s, 2]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i)
            total = fma(a1, load(h, k, o1 + i), total)
            total = fma(a2, load(h, k, o2 + i), total)
            store(out, i, fma(h, total, load(h, y, i)))
        return
    o3 = 3 * units
    if s == 4:
        a0, a1, a2, a3 = a[s, 0], a[s, 1], a[s, 2], a[s, 3]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i)
            total = fma(a1, load(h, k, o1 + i), total)
            total = fma(a2, load(h, k, o2 + i), total)
            total = fma(a3, load(h, k, o3 + i), total)
            store(out, i, fma(h, total, load(h, y, i)))
        return
    o4 = 4 * units
    if s == 5:
        a0, a1, a2, a3, a4 = a[s, 0], a[s, 1], a[s, 2], a[s, 3], a[s, 4]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i)
            total = fma(a1, load(h, k, o1 + i), total)
            total = fma(a2, load(h, k, o2 + i), total)
            total = fma(a3, load(h, k, o3 + i), total)
            total = fma(a4, load(h, k, o4 + i), total)
            store(out, i, fma(h, total, load(h, y, i)))
        return
    o5 = 5 * units
    if s == 6:
        a0, a1, a2, a3, a4, a5 = a[s, 0], a[s, 1], a[s, 2], a[s, 3], a[s, 4], a[s, 5]
        for i in range(units - 1, -1, -1):
            total = a0 * load(h, k, o0 + i)
            total = fma(a1, load(h, k, o1 + i), total)
            total = fma(a2, load(h, k, o2 + i), total)
            total = fma(a3, load(h, k, o3 + i), total)
            total = fma(a4, load(h, k, o4 + i), total)
            total = fma(a5, load(h, k, o5 + i), total)
            store(out, i, fma(h, total, load(h, y, i)))
        return
    for i in range(units - 1, -1, -1):
        total = a[s, 0] * load(h, k, o0 + i)
        for j in range(1, s):
            total = fma(a[s, j], load(h, k, j * units + i), total)
        store(out, i, fma(h, total, load(h, y, i)))


@jit()
def _add_to_both(total, error, a, e, stage):
    return fma(a, stage, total), fma(e, stage, error)


@jit()
def last_stage_sum(h, step, a, e):
    """Write the new state as `stage_sum` does, and its error estimate without the last stage.

    The stages are read once for both. The estimate ``sum_{j < s} e_j k_j`` is stored after the
    stages in ``k``. The last stage, the slope at the new state, is not known yet.
    """
    y, out, k, first, units = step
    s = e.size - 1
    errors = (s + 1) * units
    if s == 6:
        # Written out, as above.
        a0, a1, a2, a3, a4, a5 = a[s, 0], a[s, 1], a[s, 2], a[s, 3], a[s, 4], a[s, 5]
        e0, e1, e2, e3, e4, e5 = e[0], e[1], e[2], e[3], e[4], e[5]
        for i in range(units - 1, -1, -1):
            stage = load(h, k, first + i)
            total, error = a0 * stage, e0 * stage
            total, error = _add_to_both(total, error, a1, e1, load(h, k, units + i))
            total, error = _add_to_both(total, error, a2, e2, load(h, k, 2 * units + i))
            total, error = _add_to_both(total, error, a3, e3, load(h, k, 3 * units + i))
            total, error = _add_to_both(total, error, a4, e4, load(h, k, 4 * units + i))
            total, error = _add_to_both(total, error, a5, e5, load(h, k, 5 * units + i))
            store(k, errors + i, error)
            store(out, i, fma(h, total, load(h, y, i)))
        return
    for i in range(units - 1, -1, -1):
        stage = load(h, k, first + i)
        total, error = a[s, 0] * stage, e[0] * stage
        for j in range(1, s):
            total, error = _add_to_both(total, error, a[s, j], e[j], load(h, k, j * units + i))
        store(k, errors + i, error)
        store(out, i, fma(h, total, load(h, y, i)))


@jit()
def _ratio(i, context):
    h, step, (last, errors), weight, limits = context
    total = fma(weight, load(h, step.k, last + i), load(h, step.k, errors + i))
    size = larger(magnitude(load(h, step.y, i)), magnitude(load(h, step.y1, i)))
    return h * total / fma(limits.rtol, size, limits.atol)


@jit()
def _add_square(total, ratio):
    return fma(ratio, ratio, total)


@jit(inline="always")
def _add_up(zero, context, units, lane):
    # Rows are added to eight partial sums in turn, which are then folded in halves. The eight sums
    # of a single lane form a vector.
    if lane.shape[1] == 1:
        total = broadcast(0.0)
        for i in range(units):
            total = _add_square(total, _ratio(i, context))
        lane[ERROR_SUM, 0] = fold(total)
        return
    s0, s1, s2, s3, s4, s5, s6, s7 = zero, zero, zero, zero, zero, zero, zero, zero
    whole = units - units % 8
    for i in range(0, whole, 8):
        s0 = _add_square(s0, _ratio(i, context))
        s1 = _add_square(s1, _ratio(i + 1, context))
        s2 = _add_square(s2, _ratio(i + 2, context))
        s3 = _add_square(s3, _ratio(i + 3, context))
        s4 = _add_square(s4, _ratio(i + 4, context))
        s5 = _add_square(s5, _ratio(i + 5, context))
        s6 = _add_square(s6, _ratio(i + 6, context))
        s7 = _add_square(s7, _ratio(i + 7, context))
    left = units - whole
    s0 = _add_square(s0, _ratio(whole, context)) if left > 0 else s0
    s1 = _add_square(s1, _ratio(whole + 1, context)) if left > 1 else s1
    s2 = _add_square(s2, _ratio(whole + 2, context)) if left > 2 else s2
    s3 = _add_square(s3, _ratio(whole + 3, context)) if left > 3 else s3
    s4 = _add_square(s4, _ratio(whole + 4, context)) if left > 4 else s4
    s5 = _add_square(s5, _ratio(whole + 5, context)) if left > 5 else s5
    s6 = _add_square(s6, _ratio(whole + 6, context)) if left > 6 else s6
    store(lane, ERROR_SUM, ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7)))


@jit()
def error_sum(zero, h, step, e, limits, lane):
    """Sum ``(err_i / (atol + rtol max(|y_i|, |y1_i|)))**2`` over the rows, HNW eq. II.4.11.

    The error estimate is that of `last_stage_sum` plus the part of the last stage. The sum is
    written to the row `ERROR_SUM` of ``lane``.
    """
    s = e.size - 1
    places = s * step.units - step.first, (s + 1) * step.units
    _add_up(zero, (h, step, places, e[s], limits), step.units, lane)
