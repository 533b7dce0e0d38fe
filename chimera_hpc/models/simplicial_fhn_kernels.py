"""Compiled right-hand sides of the topological FitzHugh-Nagumo model on any network, any order."""

from functools import cache

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import LANES, broadcast, fma, load, store
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.models.csr_kernels import (
    add_products,
    matrix_at,
    multiply_shared,
    product,
    row_at,
)
from chimera_hpc.models.topological_fhn_kernels import activator


@jit()
def _local(zero, i, context):
    # Store du/dt of element i, and return b s + c w.
    y, dy, params, n, rate, c = context
    u, w = load(zero, y, i), load(zero, y, n + i)
    store(dy, i, activator(u, w, rate))
    return fma(c, w, load(zero, params, 2 + i))


@jit()
def _reduced(zero, y, dy, params, ints):
    laplacian = matrix_at(ints, 0)
    n = laplacian.rows
    work = zero, params, 2 + n
    multiply_shared(laplacian, y, 0, work)
    rate, c = load(zero, params, 0), load(zero, params, 1)
    context = y, dy, params, n, rate, c
    add_products(laplacian, y, 0, _local, context, (dy, n), work)


@jit()
def _full(zero, y, dy, params, ints):
    dirac, adjoint = matrix_at(ints, 0), matrix_at(ints, 1)
    n = dirac.rows
    work = zero, params, 0
    rate, b, c = load(zero, params, 0), load(zero, params, 1), load(zero, params, 2)
    for k in range(n):
        i = row_at(dirac, k)
        w = product(dirac, k, y, n, zero, work)
        store(dy, i, activator(load(zero, y, i), w, rate))
    for k in range(adjoint.rows):
        j = row_at(adjoint, k)
        local = fma(c, load(zero, y, n + j), b)
        store(dy, n + j, product(adjoint, k, y, 0, local, work))


def reduced_rhs(y, dy, lane_params, int_params):
    """Right-hand side of the reduced form; ``lane_params`` rows: 1/epsilon, c, b s_1 ... b s_N.

    ``int_params`` holds the Hodge Laplacian. Rows of ``lane_params`` after those of s are work
    space, one for each shared row of it.
    """
    if y.shape[1] == LANES:
        _reduced(broadcast(0.0), y, dy, lane_params, int_params)
    else:
        _reduced(0.0, y, dy, lane_params, int_params)


def full_rhs(y, dy, lane_params, int_params):
    """Right-hand side of the full form; ``lane_params`` rows: 1/epsilon, b, c.

    ``int_params`` holds D = [B_k^T, B_(k+1)] and its transpose, whose rows are not shared.
    """
    if y.shape[1] == LANES:
        _full(broadcast(0.0), y, dy, lane_params, int_params)
    else:
        _full(0.0, y, dy, lane_params, int_params)


@cache
def compiled(form: str):
    """Return the compiled right-hand side of a form, "reduced" or "full"."""
    return jit(RIGHT_HAND_SIDE)(reduced_rhs if form == "reduced" else full_rhs)
