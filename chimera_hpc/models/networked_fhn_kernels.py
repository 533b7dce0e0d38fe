"""Compiled right-hand side of the networked FitzHugh-Nagumo model."""

from functools import cache

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import (
    LANES,
    broadcast,
    fma,
    last_of,
    load,
    load_at,
    load_some,
    store,
    store_at,
    store_some,
)
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.models.window_sums import (
    Ring,
    changes_along,
    first_across,
    first_along,
    rest_across,
    stride_across,
)

THIRD = 1.0 / 3.0


@jit()
def _activator(x, y, pull_x, pull_y, numbers):
    rate, _, same, cross = numbers
    pull = fma(cross, pull_y, same * pull_x)
    return fma(x, fma(x * x, -THIRD, 1.0), pull - y) * rate


@jit()
def _inhibitor(x, pull_x, pull_y, numbers):
    _, b, same, cross = numbers
    return fma(same, pull_y, fma(-1.0 * cross, pull_x, x + b))


@jit()
def _keep(zero, i, total_y, context):
    _, slopes, n, _, _ = context
    store(slopes, n + i, total_y)


@jit()
def _node(zero, i, total_x, context):
    state, slopes, n, width, numbers = context
    x, y = load(zero, state, i), load(zero, state, n + i)
    pull_x = fma(-width, x, total_x)
    pull_y = fma(-width, y, load(zero, slopes, n + i))
    store(slopes, i, _activator(x, y, pull_x, pull_y, numbers))
    store(slopes, n + i, _inhibitor(x, pull_x, pull_y, numbers))


@jit()
def _across(zero, state, slopes, params, ints):
    # Node by node, in all lanes together. The slopes of y first hold the sums of y.
    n, half = ints[0], ints[1]
    numbers = (
        load(zero, params, 0),
        load(zero, params, 1),
        load(zero, params, 2),
        load(zero, params, 3),
    )
    context = (state, slopes, n, 2.0 * half + 1.0, numbers)
    ring_x, ring_y = Ring(state, 0, n, half), Ring(state, n, n, half)
    total_x, total_y = first_across(zero, ring_x), first_across(zero, ring_y)
    for i in range(0, n - LANES + 1, LANES):
        total_y = stride_across(zero, ring_y, total_y, i, _keep, context)
        total_x = stride_across(zero, ring_x, total_x, i, _node, context)
    rest_across(zero, ring_y, total_y, _keep, context)
    rest_across(zero, ring_x, total_x, _node, context)


@jit()
def _along(state, slopes, params, ints):
    # One trajectory, eight nodes at a time.
    n, half = ints[0], ints[1]
    numbers = (params[0, 0], params[1, 0], params[2, 0], params[3, 0])
    width = 2.0 * half + 1.0
    ring_x, ring_y = Ring(state, 0, n, half), Ring(state, n, n, half)
    before_x, before_y = first_along(ring_x), first_along(ring_y)
    for i in range(0, n, LANES):
        change_x = changes_along(ring_x, i)
        change_y = changes_along(ring_y, i)
        left = n - i
        x = load_at(state, i) if left >= LANES else load_some(state, i, 0, left)
        y = load_at(state, n + i) if left >= LANES else load_some(state, n + i, 0, left)
        pull_x = fma(-width, x, before_x + change_x)
        pull_y = fma(-width, y, before_y + change_y)
        slope_x = _activator(x, y, pull_x, pull_y, numbers)
        slope_y = _inhibitor(x, pull_x, pull_y, numbers)
        if left >= LANES:
            store_at(slopes, i, slope_x)
            store_at(slopes, n + i, slope_y)
        else:
            store_some(slopes, i, slope_x, left)
            store_some(slopes, n + i, slope_y, left)
        before_x, before_y = before_x + last_of(change_x), before_y + last_of(change_y)


def networked_rhs(y, dy, lane_params, int_params):
    """Right-hand side; ``lane_params`` rows: 1/epsilon, b, sigma/2P times cos and sin of phi."""
    if y.shape[1] == LANES:
        _across(broadcast(0.0), y, dy, lane_params, int_params)
    elif int_params[0] >= LANES:
        _along(y, dy, lane_params, int_params)
    else:
        _across(0.0, y, dy, lane_params, int_params)


@cache
def compiled():
    """Return the compiled right-hand side."""
    return jit(RIGHT_HAND_SIDE)(networked_rhs)
