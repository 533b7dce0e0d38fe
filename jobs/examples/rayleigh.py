r"""Rayleigh oscillators on a ring, coupled to P neighbours on each side.

.. math::
    \dot x_i &= y_i + \frac{\sigma}{2P} \sum_{0 < |k| \le P}
        [\cos\varphi\,(x_{i+k} - x_i) + \sin\varphi\,(y_{i+k} - y_i)] \\
    \dot y_i &= \varepsilon (1 - y_i^2) y_i - \omega^2 x_i + \frac{\sigma}{2P} \sum_{0 < |k| \le P}
        [-\sin\varphi\,(x_{i+k} - x_i) + \cos\varphi\,(y_{i+k} - y_i)]

Alone and for small epsilon an oscillator has amplitude 2 / sqrt(3) in y / omega = dx/dt / omega
for omega = 1, and frequency (1 - epsilon^2 / 16) / (2 pi).

arXiv 2605.09401 classifies the states of a network of Rayleigh oscillators over coupling strength
and range. The coupling here is the rotated one of the networked FitzHugh-Nagumo model (eq.
eq. (F1)); another one is a matter of two lines below.
"""

import math

from chimera_hpc import Limit, OwnModel, Parameter


def right_hand_side(y, dy, p, ints):
    """Rows of y and dy: x, then y; rows of p as `reals` returns them; ints: N, neighbours."""
    n, reach = ints[0], ints[1]
    width = 2.0 * reach + 1.0
    for lane in range(y.shape[1]):
        epsilon, square = p[0, lane], p[1, lane]
        same, cross = p[2, lane], p[3, lane]
        # Sums over the 2 P + 1 nodes around node i slide along the ring with it.
        sum_x, sum_y = 0.0, 0.0
        for k in range(-reach - 1, reach):
            sum_x += y[k % n, lane]
            sum_y += y[n + k % n, lane]
        for i in range(n):
            ahead, behind = (i + reach) % n, (i - reach - 1) % n
            sum_x += y[ahead, lane] - y[behind, lane]
            sum_y += y[n + ahead, lane] - y[n + behind, lane]
            place, speed = y[i, lane], y[n + i, lane]
            pull_x, pull_y = sum_x - width * place, sum_y - width * speed
            dy[i, lane] = speed + same * pull_x + cross * pull_y
            own = epsilon * (1.0 - speed * speed) * speed - square * place
            dy[n + i, lane] = own - cross * pull_x + same * pull_y


def reals(row, n_nodes):
    """What the right-hand side needs of the parameters, prepared once a run."""
    gain = row["sigma"] / (2 * row["P"])
    same, cross = gain * math.cos(row["phi"]), gain * math.sin(row["phi"])
    return row["epsilon"], row["omega"] ** 2, same, cross


def initial(rng, row, n_nodes):
    """Anywhere in the square of side 2, node by node."""
    return rng.uniform(-1.0, 1.0, (2, n_nodes))


MODEL = OwnModel(
    right_hand_side,
    variables=("x", "y"),
    parameters=(
        Parameter("sigma", float, None, "Strength of the coupling."),
        Parameter("P", int, None, "Neighbours to each side.", low=1),
        Parameter("phi", float, math.pi / 2 - 0.1, "Angle of the coupling matrix (rad)."),
        Parameter("epsilon", float, 0.5, "Strength of the nonlinear friction."),
        Parameter("omega", float, 1.0, "Frequency of the linear oscillator.", above=0),
    ),
    n_nodes=100,
    initial=initial,
    reals=reals,
    limits=(Limit("P", (), lambda columns, n: (n - 1) // 2, "2 P must be smaller than n_nodes"),),
)
