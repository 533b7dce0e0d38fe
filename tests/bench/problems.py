"""The problems that all contenders solve, and solutions to judge them by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from chimera_hpc import Topology

Array = NDArray[np.float64]

EPSILON, B, C = 0.05, 0.5, -0.01


@dataclass(frozen=True)
class Ring:
    """The ring with Q = P, an initial state for each seed, and sampling times."""

    half_degree: int
    n_nodes: int = 50
    t_end: float = 200.0
    t_step: float = 0.01

    @cached_property
    def topology(self) -> Topology:
        ring = Topology.ring(self.n_nodes, self.half_degree)
        return ring.reorient_node(0, self.half_degree)

    @cached_property
    def times(self) -> Array:
        return self.t_step * np.arange(round(self.t_end / self.t_step) + 1)

    def initial(self, seed: int) -> tuple[Array, Array]:
        """Return u0 (N0,) and v0 (N1,)."""
        rng = np.random.default_rng([seed, self.half_degree, self.n_nodes])
        state = 1e-3 * rng.uniform(-1.0, 1.0, self.n_nodes + self.topology.n_links)
        return state[: self.n_nodes], state[self.n_nodes :]

    def reference(self, seed: int, t_end: float) -> Array:
        """Return u (T, N0) as far as `t_end` by SciPy's DOP853 at rtol 1e-13, in reduced form."""
        u, v = self.initial(seed)
        w = self.topology.gather_links(v)
        laplacian = (self.topology.incidence @ self.topology.incidence.T).toarray()
        source = B * self.topology.divergence

        def slope(t: float, y: Array) -> Array:
            u, w = y[: self.n_nodes], y[self.n_nodes :]
            return np.concatenate([(u - u**3 / 3 - w) / EPSILON, source + C * w + laplacian @ u])

        times = self.times[self.times <= t_end + 1e-9]
        done = solve_ivp(
            slope,
            (0.0, times[-1]),
            np.concatenate([u, w]),
            method="DOP853",
            t_eval=times,
            rtol=1e-13,
            atol=1e-14,
        )
        return np.asarray(done.y[: self.n_nodes].T)


def error(u: Array, reference: Array) -> float:
    """Return the largest difference from the reference as far as that goes."""
    return float(np.abs(u[: len(reference)] - reference).max())
