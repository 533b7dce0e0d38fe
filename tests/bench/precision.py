"""Work against precision: seconds a trajectory over the error that it bought."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
import peers
from measure import interleaved, medians
from numpy.typing import NDArray
from problems import Ring, error

from chimera_hpc import simulate
from chimera_hpc.integrate.lanes import Control, Outcome, integrate
from chimera_hpc.job import registry
from chimera_hpc.models.topological_fhn import TopologicalFHN

Array = NDArray[np.float64]
Curve = list[tuple[float, float]]
"""(error, seconds a trajectory) for each tolerance."""

SEEDS = 8


def curves(tolerances: tuple[float, ...], repeats: int, with_jax: bool) -> dict[str, Curve]:
    """Return a curve for each method: P = 12, u every 0.01 up to t = 20."""
    ring = Ring(12, t_end=20.0)
    reference = ring.reference(0, 20.0)
    u0, v0 = ring.initial(0)
    runs: dict[str, Callable[[float], Array]] = {}
    for method in registry.METHODS:
        runs[f"ours, {method}"] = lambda rtol, method=method: (
            simulate(
                ring.topology, u0=u0, v0=v0, t_end=20.0, rtol=rtol, atol=1e-3 * rtol, method=method
            ).u
        )
    runs["ours, tsit5, eight lanes"] = lambda rtol: _lanes(ring, rtol)
    for method in ("RK45", "DOP853"):
        runs[f"SciPy {method}, reduced"] = lambda rtol, method=method: peers.scipy_reduced(
            ring, 0, rtol, method
        )
    if with_jax:
        runs["diffrax Tsit5, reduced"] = _diffrax(ring)
    found: dict[str, Curve] = {name: [] for name in runs}
    for rtol in tolerances:
        bound = {name: partial(run, rtol) for name, run in runs.items()}
        times = medians(interleaved(bound, repeats))
        for name, run in bound.items():
            share = SEEDS if "lanes" in name else 1
            found[name].append((error(run(), reference), times[name] / share))
    return found


def _diffrax(ring: Ring) -> Callable[[float], Array]:
    state = peers.states(ring, "reduced", range(1))
    # One compilation a tolerance.
    solver = cache(lambda rtol: peers.diffrax(ring, "reduced", rtol))
    return lambda rtol: solver(rtol)(state)[0]


def _lanes(ring: Ring, rtol: float) -> Array:
    """Eight trajectories at once; the first one's u."""
    model = TopologicalFHN(ring.topology)
    states = [model.state(*ring.initial(seed)) for seed in range(SEEDS)]
    control = Control(ring.t_end, 0.0, ring.t_step, rtol, 1e-3 * rtol)
    kept: dict[int, Array] = {}

    def on_end(number: int, end: Outcome) -> None:
        if number == 0:
            kept[0] = end.samples[: ring.n_nodes].T.copy()

    integrate([model] * SEEDS, states, control, ring.n_nodes, on_end, lanes=8)
    return kept[0]
