"""Compiled right-hand sides of the topological FitzHugh-Nagumo model on a ring."""

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
def activator(u, w, rate):
    """Return du/dt, ``rate`` = 1/epsilon."""
    # With opposite signs: (u^3 / 3 - u + w) * -rate.
    return fma(u, fma(u * u, THIRD, -1.0), w) * (-1.0 * rate)


@jit()
def _recovery(u, w, source, total, width, c):
    return fma(c, w, source) - fma(-width, u, total)


# (L0 u)_i = (2P + 1) u_i - sum_{|k| <= P} u_{i+k}; the sum is over a sliding window.


@jit()
def _node(zero, i, total, context):
    y, dy, params, n, width, c, rate = context
    u, w = load(zero, y, i), load(zero, y, n + i)
    store(dy, i, activator(u, w, rate))
    store(dy, n + i, _recovery(u, w, load(zero, params, 2 + i), total, width, c))


@jit()
def _reduced_across(zero, y, dy, params, ints):
    # Node by node, in all lanes together.
    n, half = ints[0], ints[1]
    rate, c = load(zero, params, 0), load(zero, params, 1)
    context = (y, dy, params, n, 2.0 * half + 1.0, c, rate)
    ring = Ring(y, 0, n, half)
    total = first_across(zero, ring)
    for i in range(0, n - LANES + 1, LANES):
        total = stride_across(zero, ring, total, i, _node, context)
    rest_across(zero, ring, total, _node, context)


@jit()
def _reduced_along(y, dy, params, ints):
    # One trajectory, eight nodes at a time.
    n, half = ints[0], ints[1]
    rate, c = params[0, 0], params[1, 0]
    width = 2.0 * half + 1.0
    ring = Ring(y, 0, n, half)
    before = first_along(ring)
    for i in range(0, n, 8):
        x = changes_along(ring, i)
        total = before + x
        before = before + last_of(x)
        if i + 8 <= n:
            u, w = load_at(y, i), load_at(y, n + i)
            source = load_at(params, 2 + i)
            store_at(dy, i, activator(u, w, rate))
            store_at(dy, n + i, _recovery(u, w, source, total, width, c))
        else:
            u, w = load_some(y, i, 0, n - i), load_some(y, n + i, 0, n - i)
            source = load_some(params, 2 + i, 0, n - i)
            store_some(dy, i, activator(u, w, rate), n - i)
            store_some(dy, n + i, _recovery(u, w, source, total, width, c), n - i)


@jit()
def _full(like, y, dy, params, ints):
    # Rows of y: u (n), then v of link i * P + (k - 1) between i and i + k. Its orientation is the
    # sign in params: +1 if i is the tail.
    n, half = ints[0], ints[1]
    rate, b, c = load(like, params, 0), load(like, params, 1), load(like, params, 2)
    for i in range(n):
        u = load(like, y, i)
        store(dy, i, u - u * u * u * THIRD)
    for i in range(n):
        for k in range(1, half + 1):
            j = i + k if i + k < n else i + k - n
            link = i * half + k - 1
            sign = load(like, params, 3 + link)
            v = load(like, y, n + link)
            store(dy, j, load(like, dy, j) - sign * v)
            store(dy, i, load(like, dy, i) + sign * v)
            flow = sign * (load(like, y, j) - load(like, y, i))
            store(dy, n + link, b + c * v + flow)
    for i in range(n):
        store(dy, i, load(like, dy, i) * rate)


def reduced_rhs(y, dy, lane_params, int_params):
    """Right-hand side of the reduced form; ``lane_params`` rows: 1/epsilon, c, b s_1 ... b s_N."""
    if y.shape[1] == LANES:
        _reduced_across(broadcast(0.0), y, dy, lane_params, int_params)
    elif int_params[0] >= LANES:
        _reduced_along(y, dy, lane_params, int_params)
    else:
        _reduced_across(0.0, y, dy, lane_params, int_params)


def full_rhs(y, dy, lane_params, int_params):
    """Right-hand side of the node-link form; ``lane_params`` rows: 1/epsilon, b, c, link signs."""
    if y.shape[1] == LANES:
        _full(broadcast(0.0), y, dy, lane_params, int_params)
    else:
        _full(0.0, y, dy, lane_params, int_params)


@cache
def compiled(form: str):
    """Return the compiled right-hand side of a form, "reduced" or "full"."""
    return jit(RIGHT_HAND_SIDE)(reduced_rhs if form == "reduced" else full_rhs)
