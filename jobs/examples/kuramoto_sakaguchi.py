r"""Kuramoto-Sakaguchi phase oscillators on a ring, coupled to R neighbours on each side.

.. math::
    \dot\varphi_i = \omega - \frac{K}{2R} \sum_{0 < |k| \le R}
        \sin(\varphi_i - \varphi_{i+k} + \alpha)

(Kuramoto and Battogtokh, Nonlinear Phenom. Complex Syst. 5 (2002) 380; with this coupling Wolfrum
and Omel'chenko, Phys. Rev. E 84 (2011) 015201). In phase, every oscillator turns at
omega - K sin(alpha), and that state is stable for alpha < pi/2.

The variables are x = cos(phi) and y = sin(phi): they stay bounded, so that an error tolerance
means the same at all times, and the coupling needs no trigonometric functions. The term
(1 - x^2 - y^2) keeps rounding from leaving the circle; on the circle it is zero.
"""

import math

import numpy as np

from chimera_hpc import Limit, OwnModel, Parameter


def right_hand_side(y, dy, p, ints):
    """Rows of y and dy: x, then y; rows of p as `reals` returns them; ints: N, neighbours."""
    n, reach = ints[0], ints[1]
    for lane in range(y.shape[1]):
        omega, gain = p[0, lane], p[1, lane]
        cos_alpha, sin_alpha = p[2, lane], p[3, lane]
        # Sums over the 2 R + 1 nodes around node i slide along the ring with it.
        sum_x, sum_y = 0.0, 0.0
        for k in range(-reach - 1, reach):
            sum_x += y[k % n, lane]
            sum_y += y[n + k % n, lane]
        for i in range(n):
            ahead, behind = (i + reach) % n, (i - reach - 1) % n
            sum_x += y[ahead, lane] - y[behind, lane]
            sum_y += y[n + ahead, lane] - y[n + behind, lane]
            cos, sin = y[i, lane], y[n + i, lane]
            # sin(phi_i + alpha) and cos(phi_i + alpha)
            a = sin * cos_alpha + cos * sin_alpha
            b = cos * cos_alpha - sin * sin_alpha
            speed = omega - gain * (a * (sum_x - cos) - b * (sum_y - sin))
            pull = 1.0 - cos * cos - sin * sin
            dy[i, lane] = pull * cos - speed * sin
            dy[n + i, lane] = pull * sin + speed * cos


def reals(row, n_nodes):
    """What the right-hand side needs of the parameters, prepared once a run."""
    gain = row["K"] / (2 * row["R"])
    return row["omega"], gain, math.cos(row["alpha"]), math.sin(row["alpha"])


def initial(rng, row, n_nodes):
    """Random phases under a bump: incoherent in the middle, coherent at the ends."""
    place = np.arange(n_nodes) / n_nodes - 0.5
    phase = row["spread"] * np.exp(-30.0 * place**2) * rng.uniform(-0.5, 0.5, n_nodes)
    return np.cos(phase), np.sin(phase)


MODEL = OwnModel(
    right_hand_side,
    variables=("x", "y"),
    parameters=(
        Parameter("alpha", float, 1.46, "Phase lag (rad)."),
        Parameter("R", int, 35, "Neighbours to each side.", low=1),
        Parameter("K", float, 1.0, "Strength of the coupling."),
        Parameter("omega", float, 2 * math.pi, "Own frequency (rad a unit of time)."),
        Parameter("spread", float, 6.0, "Width of the random initial phases (rad).", low=0),
    ),
    n_nodes=100,
    initial=initial,
    reals=reals,
    limits=(Limit("R", (), lambda columns, n: (n - 1) // 2, "2 R must be smaller than n_nodes"),),
)
