"""Compiled right-hand sides of models with two variables per node, coupled by a sparse matrix."""

from functools import cache

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import LANES, broadcast, fma, load, store
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.models.csr_kernels import matrix_at, multiply_shared_twice, products, row_at

THIRD = 1.0 / 3.0


@jit()
def _fhn(zero, state, slopes, params, ints):
    matrix = matrix_at(ints, 0)
    n = matrix.rows
    rate, b = load(zero, params, 0), load(zero, params, 1)
    same, cross = load(zero, params, 2), load(zero, params, 3)
    rows, work = (0, n), (zero, params, 4)
    multiply_shared_twice(matrix, state, rows, work)
    for k in range(n):
        i = row_at(matrix, k)
        x, y = load(zero, state, i), load(zero, state, n + i)
        pull_x, pull_y = products(matrix, k, state, rows, (zero, zero), work)
        pull = fma(cross, pull_y, same * pull_x)
        store(slopes, i, fma(x, fma(x * x, -THIRD, 1.0), pull - y) * rate)
        store(slopes, n + i, fma(same, pull_y, fma(-1.0 * cross, pull_x, x + b)))


@jit()
def _stuart_landau(zero, state, slopes, params, ints):
    matrix = matrix_at(ints, 0)
    n = matrix.rows
    growth, shear = load(zero, params, 0), load(zero, params, 1)
    same, cross = load(zero, params, 2), load(zero, params, 3)
    rows, work = (0, n), (zero, params, 4 + n)
    multiply_shared_twice(matrix, state, rows, work)
    for k in range(n):
        i = row_at(matrix, k)
        x, y = load(zero, state, i), load(zero, state, n + i)
        pull_x, pull_y = products(matrix, k, state, rows, (zero, zero), work)
        square = fma(x, x, y * y)
        gain = growth - square
        turn = fma(-1.0 * shear, square, load(zero, params, 4 + i))
        # K exp(-i alpha) (pull_x + i pull_y), then (gain + i turn) (x + i y).
        real = fma(cross, pull_y, same * pull_x)
        imaginary = fma(-1.0 * cross, pull_x, same * pull_y)
        store(slopes, i, fma(gain, x, fma(-1.0 * turn, y, real)))
        store(slopes, n + i, fma(gain, y, fma(turn, x, imaginary)))


def networked_fhn(y, dy, lane_params, int_params):
    """Right-hand side; ``lane_params`` rows: 1/epsilon, b, sigma cos(phi), sigma sin(phi), work."""
    if y.shape[1] == LANES:
        _fhn(broadcast(0.0), y, dy, lane_params, int_params)
    else:
        _fhn(0.0, y, dy, lane_params, int_params)


def stuart_landau(y, dy, lane_params, int_params):
    """Right-hand side; ``lane_params`` rows: lambda, gamma, K cos and sin of alpha, omega, work."""
    if y.shape[1] == LANES:
        _stuart_landau(broadcast(0.0), y, dy, lane_params, int_params)
    else:
        _stuart_landau(0.0, y, dy, lane_params, int_params)


@cache
def compiled(name: str):
    """Return the compiled right-hand side of "networked_fhn" or "stuart_landau"."""
    return jit(RIGHT_HAND_SIDE)(networked_fhn if name == "networked_fhn" else stuart_landau)
