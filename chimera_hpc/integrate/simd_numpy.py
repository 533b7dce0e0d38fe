"""The functions of `simd` without compilation: a vector is a NumPy array of `LANES` numbers."""

import ctypes

import numpy as np

from chimera_hpc.integrate.simd_constants import LANES, SCAN


def broadcast(value):
    """Return a vector with ``value`` in every lane."""
    return np.full(LANES, value)


def load(like, array, row):
    """Read row ``row`` of ``array`` (rows, lanes) as the type of ``like``."""
    return array[row, 0] if np.ndim(like) == 0 else load_at(array, row * LANES)


def store(array, row, value):
    """Write a number or a vector into row ``row`` of ``array`` (rows, lanes)."""
    if np.ndim(value):
        store_at(array, row * LANES, value)
    else:
        array[row, 0] = value


def across(like, array, row):
    """Read the lanes' numbers as a vector. The number of a single lane is broadcast."""
    return np.full(LANES, array[row, 0]) if np.ndim(like) == 0 else array[row].copy()


def load_at(array, offset):
    """Read `LANES` contiguous numbers of ``array``."""
    return array.reshape(-1)[offset : offset + LANES].copy()


def store_at(array, offset, vector):
    """Write a vector to contiguous numbers of ``array``."""
    array.reshape(-1)[offset : offset + LANES] = vector


def load_some(array, offset, low, high):
    """Read elements ``low <= j < high`` of a vector as `load_at` does; -0.0 elsewhere."""
    vector = np.full(LANES, -0.0)
    vector[low:high] = array.reshape(-1)[offset + low : offset + high]
    return vector


def store_some(array, offset, vector, count):
    """Write the first ``count`` elements of a vector as `store_at` does."""
    array.reshape(-1)[offset : offset + count] = vector[:count]


def add_shifted(vector, level):
    """Do one level of `SCAN` within a vector."""
    source = np.array(SCAN[level])
    return vector + np.where(source < LANES, vector[source % LANES], -0.0)


def last_of(vector):
    """Return the last element of a vector."""
    return vector[LANES - 1]


def fold(vector):
    """Sum a vector: add its halves until one number is left."""
    half = vector[:4] + vector[4:]
    quarter = half[:2] + half[2:]
    return quarter[0] + quarter[1]


def integer_at(array, offset):
    """Read one number of an int64 ``array``; the offset must not be negative."""
    return array[offset]


def real_at(array, offset):
    """Read the bits of one number of an int64 ``array`` as a float64."""
    return array[offset : offset + 1].view(np.float64)[0]


def stream_at(array, offset, vector):
    """Write as `store_at` does, but bypass the caches. The address must start a cache line."""
    store_at(array, offset, vector)


def transposed(vectors):
    """Transpose eight vectors: vector m of the result holds element m of each."""
    return tuple(np.stack(vectors).T.copy())


_fused = ctypes.CDLL(None).fma  # of the C library
_fused.restype, _fused.argtypes = ctypes.c_double, 3 * [ctypes.c_double]


def fma(a, b, c):
    """Return ``a * b + c``, lane by lane, rounded once: IEEE 754's fusedMultiplyAdd."""
    columns = np.broadcast_arrays(a, b, c)
    each = [_fused(*numbers) for numbers in np.stack(columns).reshape(3, -1).T]
    return np.array(each) if len(each) > 1 else np.float64(each[0])


def larger(a, b):
    """Return the larger of two numbers, lane by lane; ``b`` where either is NaN."""
    return np.where(a > b, a, b) if np.ndim(a) else (a if a > b else b)


def magnitude(a):
    """Return the absolute value, lane by lane."""
    return np.abs(a)
