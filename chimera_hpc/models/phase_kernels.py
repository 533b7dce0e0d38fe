"""Compiled right-hand sides of phase oscillators on networks and simplicial complexes."""

import math
from functools import cache

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import (
    LANES,
    broadcast,
    fma,
    load,
    load_some,
    store,
    store_some,
)
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.models.csr_kernels import (
    matrix_at,
    multiply_shared_twice,
    product,
    products,
    row_at,
)
from chimera_hpc.models.trigonometry import sin_cos

# Sines and cosines are kept in rows of the lanes' parameters, as work space.


@jit()
def _waves_across(zero, y, params, at, n):
    # Node by node, in all lanes together.
    for i in range(n):
        sine, cosine = sin_cos(load(zero, y, i))
        store(params, at + i, sine)
        store(params, at + n + i, cosine)


@jit()
def _waves_along(zero, y, params, at, n):
    # One trajectory, eight nodes at a time.
    for i in range(0, n, LANES):
        left = min(n - i, LANES)
        sine, cosine = sin_cos(load_some(y, i, 0, left))
        store_some(params, at + i, sine, left)
        store_some(params, at + n + i, cosine, left)


@jit()
def _sakaguchi(zero, dy, params, ints):
    # With s, c = sin, cos of theta: sin(theta_j - theta_i - alpha) =
    # cos(alpha) (s_j c_i - c_j s_i) - sin(alpha) (s_j s_i + c_j c_i).
    matrix = matrix_at(ints, 0)
    n = matrix.rows
    same, cross = load(zero, params, 0), load(zero, params, 1)
    sines, cosines = 2 + n, 2 + 2 * n
    rows, work = (sines, cosines), (zero, params, 2 + 3 * n)
    multiply_shared_twice(matrix, params, rows, work)
    for k in range(n):
        i = row_at(matrix, k)
        s, c = load(zero, params, sines + i), load(zero, params, cosines + i)
        sum_s, sum_c = products(matrix, k, params, rows, (zero, zero), work)
        ahead = fma(sum_s, c, sum_c * s * -1.0)
        along = fma(sum_s, s, sum_c * c)
        total = fma(same, ahead, load(zero, params, 2 + i))
        store(dy, i, fma(cross * -1.0, along, total))


def sakaguchi_rhs(y, dy, lane_params, int_params):
    """Right-hand side; ``lane_params`` rows: K cos(alpha), K sin(alpha), omega, sines, cosines."""
    n = int_params[0]
    if y.shape[1] == LANES:
        _waves_across(broadcast(0.0), y, lane_params, 2 + n, n)
        _sakaguchi(broadcast(0.0), dy, lane_params, int_params)
    else:
        _waves_along(broadcast(0.0), y, lane_params, 2 + n, n)
        _sakaguchi(0.0, dy, lane_params, int_params)


@jit()
def _mean_length(params, places, cosine, sine):
    # Writes |sum of cosines + i sines| / number of a part into row ``cosine``.
    first, end = places
    for m in range(params.shape[1]):
        a, b = params[cosine, m], params[sine, m]
        params[cosine, m] = math.sqrt(a * a + b * b) / (end - first)


@jit()
def _forces(zero, y, params, at, adjoint, places, sums):
    # Sines of the projections D^T theta of one part, and the sums of their cosines and sines.
    first, end = places
    total_c, total_s = zero, zero
    for k in range(first, end):
        j = row_at(adjoint, k)
        sine, cosine = sin_cos(product(adjoint, k, y, 0, zero, (zero, params, 0)))
        store(params, at + j, sine)
        total_c, total_s = total_c + cosine, total_s + sine
    store(params, sums, total_c)
    store(params, sums + 1, total_s)


@jit()
def _scale(zero, params, places, at, strength):
    # By the order parameter of the other part, which is in row ``strength``.
    first, end = places
    factor = load(zero, params, strength)
    for j in range(first, end):
        store(params, at + j, load(zero, params, at + j) * factor)


@jit()
def _simplicial(zero, y, dy, params, ints, explosive):
    dirac, adjoint = matrix_at(ints, 0), matrix_at(ints, 1)
    n, lower = dirac.rows, ints[16]
    sums, at = 1 + n, 5 + n
    down, up = (0, lower), (lower, adjoint.rows)
    _forces(zero, y, params, at, adjoint, down, sums)
    _forces(zero, y, params, at, adjoint, up, sums + 2)
    if explosive:
        _mean_length(params, down, sums, sums + 1)
        _mean_length(params, up, sums + 2, sums + 3)
        _scale(zero, params, down, at, sums + 2)
        _scale(zero, params, up, at, sums)
    strength = load(zero, params, 0)
    for k in range(n):
        i = row_at(dirac, k)
        pull = product(dirac, k, params, at, zero, (zero, params, 0))
        store(dy, i, fma(strength * -1.0, pull, load(zero, params, 1 + i)))


def simplicial_rhs(y, dy, lane_params, int_params):
    """Right-hand side; ``lane_params`` rows: K, omega, four sums, the sines of D^T theta."""
    if y.shape[1] == LANES:
        _simplicial(broadcast(0.0), y, dy, lane_params, int_params, False)
    else:
        _simplicial(0.0, y, dy, lane_params, int_params, False)


def explosive_rhs(y, dy, lane_params, int_params):
    """Right-hand side of the explosive variant; arguments as in `simplicial_rhs`."""
    if y.shape[1] == LANES:
        _simplicial(broadcast(0.0), y, dy, lane_params, int_params, True)
    else:
        _simplicial(0.0, y, dy, lane_params, int_params, True)


RIGHT_HAND_SIDES = {
    "kuramoto_sakaguchi": sakaguchi_rhs,
    "simplicial_kuramoto": simplicial_rhs,
    "explosive": explosive_rhs,
}


@cache
def compiled(name: str):
    """Return a compiled right-hand side by its name in `RIGHT_HAND_SIDES`."""
    return jit(RIGHT_HAND_SIDE)(RIGHT_HAND_SIDES[name])
