"""Right-hand sides with known solutions, and ways to drive the real stepping loop by hand."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from chimera_hpc.integrate import lane_rows as K
from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.lanes import Control, LanePool, Outcome, integrate
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.job import registry

METHODS = {name: registry.method(name) for name in registry.METHODS}

compiled = jit(RIGHT_HAND_SIDE)


@compiled
def linear(y, dy, lane_params, int_params):
    """y' = A y; the rows of A stand one after the other in the lane's parameters."""
    n = int_params[0]
    for lane in range(y.shape[1]):
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += lane_params[i * n + j, lane] * y[j, lane]
            dy[i, lane] = total


@compiled
def kepler(y, dy, lane_params, int_params):
    """Two bodies: position (x, y) and velocity, with the attraction as parameter."""
    for lane in range(y.shape[1]):
        square = y[0, lane] ** 2 + y[1, lane] ** 2
        pull = -lane_params[0, lane] / (square * np.sqrt(square))
        dy[0, lane] = y[2, lane]
        dy[1, lane] = y[3, lane]
        dy[2, lane] = pull * y[0, lane]
        dy[3, lane] = pull * y[1, lane]


@compiled
def powers(y, dy, lane_params, int_params):
    """y' = rate * y**exponent in each of two rows: decays, or ends in finite time."""
    for lane in range(y.shape[1]):
        for i in range(2):
            dy[i, lane] = lane_params[0, lane] * y[i, lane] ** lane_params[1, lane]


@dataclass(frozen=True)
class System:
    """A right-hand side with its parameters, as the integrator wants it."""

    right_hand_side: Any
    lane_params: np.ndarray
    n_rows: int
    int_params: np.ndarray = field(default_factory=lambda: np.zeros(1, dtype=np.int64))


@dataclass(frozen=True)
class Run:
    """An outcome with its own copy of the samples."""

    outcome: Outcome
    samples: np.ndarray

    @property
    def bits(self):
        """Everything but the time it took, to be compared exactly."""
        o = self.outcome
        return o.status, o.steps, o.n_sampled, o.y_end.tobytes(), self.samples.tobytes()


def run_all(systems, states, control, n_observed=None, **options):
    """Integrate and return a `Run` for each trajectory, in the order of the systems."""
    runs = {}

    def on_end(number, outcome):
        assert number not in runs, "a trajectory ended twice"
        runs[number] = Run(outcome, outcome.samples[:, : outcome.n_sampled].copy())

    observed = systems[0].n_rows if n_observed is None else n_observed
    integrate(systems, states, control, observed, on_end, **options)
    return [runs[number] for number in range(len(systems))]


def fixed_steps(system, y0, counts, t_end, method, sampling=None):
    """Cross [0, t_end] in equal steps with the real loop, one number of steps for each lane.

    The step size of each lane is set before each call of the loop, which tries one step; the
    tolerance is too loose to reject any. Returns the last states (rows, lanes) and the samples.
    """
    assert len(counts) == LANES
    control = Control(t_end, 0.0, sampling or t_end, rtol=1e6, atol=1e6, method=method)
    pool = LanePool(LANES, system, control, system.n_rows)
    for lane in range(LANES):
        pool.put(lane, y0, system.lane_params)
    pool.iterations = 0
    pool.run()
    while (running := pool.lanes.counters[K.STATE] == K.RUNNING).any():
        final = pool.lanes.counters[K.ACCEPTED] == np.array(counts) - 1
        h = np.where(final, t_end - pool.lanes.lane[K.TIME], t_end / np.array(counts))
        pool.lanes.lane[K.STEP] = np.where(running, h, 0.0)
        pool.iterations = 1
        pool.run()
    assert list(pool.lanes.counters[K.ACCEPTED]) == list(counts)
    samples = np.stack([pool.sampled(lane) for lane in range(LANES)])
    return pool.lanes.y[: pool.size].copy(), samples
