"""Sine and cosine together, of a number or of a vector, with the same bits.

The argument is reduced by the nearest multiple k of pi/2 (in two parts, with fused
multiply-adds), then both Taylor series are summed on [-pi/4, pi/4]. Polynomials in k mod 4 turn the
pair back, so no lane takes a branch. The absolute error is below 4e-16 for |x| up to 1e6. NaN and
infinities give NaN.
"""

import math

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import fma

TWO_OVER_PI = 2.0 / math.pi
# pi/2 as the sum of two float64.
PART_1, PART_2 = math.pi / 2, 6.123233995736766e-17
# Adding and subtracting it rounds to the nearest integer.
ROUND = 1.5 * 2.0**52
S3, S5, S7, S9, S11, S13, S15 = ((-1) ** k / math.factorial(2 * k + 1) for k in range(1, 8))
C4, C6, C8, C10, C12, C14, C16 = ((-1) ** k / math.factorial(2 * k) for k in range(2, 9))
THIRD, SIXTH = 1.0 / 3.0, 1.0 / 6.0


@jit()
def _series(r):
    z = r * r
    odd = fma(z, fma(z, fma(z, S15, S13), S11), S9)
    odd = fma(z, fma(z, fma(z, odd, S7), S5), S3)
    even = fma(z, fma(z, fma(z, C16, C14), C12), C10)
    even = fma(z, fma(z, fma(z, even, C8), C6), C4)
    return fma(r * z, odd, r), fma(z, fma(z, even, -0.5), 1.0)


@jit()
def sin_cos(x):
    """Return (sin x, cos x)."""
    k = fma(x, TWO_OVER_PI, ROUND) - ROUND
    s, c = _series(fma(k, -PART_2, fma(k, -PART_1, x)))
    q = fma(-4.0, fma(k, 0.25, ROUND) - ROUND, k)
    square = q * q
    # sin and cos of q pi/2, for q = -2 ... 2.
    turn_s = q * (4.0 - square) * THIRD
    turn_c = (square - 1.0) * (square - 6.0) * SIXTH
    return fma(s, turn_c, c * turn_s), fma(c, turn_c, s * turn_s * -1.0)
