"""Sine and cosine of the kernels: accuracy, and the same bits for numbers and vectors."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from chimera_hpc.integrate.simd import LANES, load, load_at, store, store_at
from chimera_hpc.models.trigonometry import sin_cos


@numba.njit
def by_vector(x, out):
    """Sines, then cosines, of eight numbers at a time."""
    for i in range(0, x.size, LANES):
        s, c = sin_cos(load_at(x, i))
        store_at(out, i, s)
        store_at(out, x.size + i, c)


@numba.njit
def one_by_one(x, out):
    """Sines, then cosines, of one number at a time."""
    for i in range(x.size):
        s, c = sin_cos(load(0.0, x, i))
        store(out, i, s)
        store(out, x.size + i, c)


def both(x):
    x = np.asarray(x, dtype=np.float64).reshape(-1, 1)
    outs = np.empty((2, 2 * x.size, 1))
    by_vector(x, outs[0])
    one_by_one(x, outs[1])
    assert outs[0].tobytes() == outs[1].tobytes()
    return outs[0, : x.size, 0], outs[0, x.size :, 0]


@pytest.mark.parametrize("size", [1e-9, 1.0, 4.0, 1e3, 1e6])
def test_accuracy(size):
    x = np.random.default_rng(0).uniform(-size, size, 8000)
    sine, cosine = both(x)
    assert np.abs(sine - np.sin(x)).max() <= 2.3e-16
    assert np.abs(cosine - np.cos(x)).max() <= 2.3e-16


def test_multiples_of_a_quarter_turn():
    x = np.arange(-16, 16) * (np.pi / 2)
    sine, cosine = both(x)
    np.testing.assert_allclose(sine, np.sin(x), rtol=1e-14, atol=1e-30)
    np.testing.assert_allclose(cosine, np.cos(x), rtol=1e-14, atol=1e-30)
    assert (sine[16], cosine[16]) == (0.0, 1.0)


def test_what_is_not_finite_gives_nan():
    sine, cosine = both([np.nan, np.inf, -np.inf, 0, 0, 0, 0, 0])
    assert np.isnan(sine[:3]).all()
    assert np.isnan(cosine[:3]).all()
    assert (sine[3:] == 0.0).all()
