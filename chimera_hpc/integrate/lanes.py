"""Run many trajectories in the lanes of the stepping loop: start new ones, take finished ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.foreign import foreign_code
from chimera_hpc.base.status import Status
from chimera_hpc.integrate import stepper
from chimera_hpc.integrate.arguments import Lanes, Limits, Method
from chimera_hpc.integrate.lane_rows import (
    ACCEPTED,
    COUNT_ROWS,
    FRESH,
    IDLE,
    LANE_ROWS,
    LOG_ERROR,
    NEXT_SAMPLE,
    RUNNING,
    STATE,
)
from chimera_hpc.integrate.scratch import aligned, scratch_buffer
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.integrate.tableau import Tableau
from chimera_hpc.integrate.tsit5 import TSIT5

Array = NDArray[np.float64]

# Target wall time of one call of the compiled loop, seconds. Between calls, Python holds the GIL
# and handles time-outs and stop signals.
SLICE = 0.1
# Steps times size of the state in the first call, before the speed is known; its largest number of
# steps.
FIRST_WORK, FIRST_STEPS = 2_000_000, 64
# Largest size of the sample buffers of all lanes, bytes. Fewer lanes are used beyond it.
SAMPLE_BYTES = 96_000_000
# Largest state of `LANES` trajectories together, bytes: it must fit in a core's second-level cache.
# Beyond it, single trajectories are faster, because each needs an eighth of the memory.
VECTOR_BYTES = 1_000_000
# Fewer trajectories than this run one by one, because idle lanes cost as much as busy ones.
VECTOR_TRAJECTORIES = 3


class System(Protocol):
    """What the integrator needs of a model with its parameters (see `models`)."""

    @property
    def n_rows(self) -> int: ...
    @property
    def right_hand_side(self) -> Any: ...
    @property
    def int_params(self) -> NDArray[np.int64]: ...
    @property
    def lane_params(self) -> Array: ...


@dataclass(frozen=True)
class Control:
    """How to integrate and where to sample.

    Samples are taken at ``start + i * step`` up to ``t_end``.
    """

    t_end: float
    start: float
    step: float
    rtol: float = 1e-3
    atol: float = 1e-6
    method: Tableau = TSIT5
    max_steps: int = 10_000_000
    time_out: float = 600.0

    @property
    def n_samples(self) -> int:
        """Number of sampling times."""
        # Tolerates rounding: (1000 - 950) / 0.01 is slightly less than 5000.
        return int((self.t_end - self.start) / self.step + 1e-6) + 1

    @property
    def times(self) -> Array:
        """Sampling times, shape (n_samples,)."""
        times: Array = np.minimum(self.start + np.arange(self.n_samples) * self.step, self.t_end)
        return times


@dataclass(frozen=True)
class Outcome:
    """Result of one trajectory: status, work done, sampled rows and last state.

    ``samples`` (n_observed, n_samples) is a view of a buffer, contiguous in the observed rows. The
    buffer is used again, also by later calls of `integrate`, so copy it if it is needed later. The
    first ``n_sampled`` columns are valid. ``status`` is DONE or a failure of the integrator.
    """

    status: Status
    steps: int
    elapsed: float
    samples: Array
    n_sampled: int
    y_end: Array


class Stopped(Exception):
    """The caller asked to stop before every trajectory had ended."""


class LanePool:
    """The lanes of the stepping loop and the trajectory in each of them.

    ``samples`` (lanes, n_samples, width) is a buffer for samples in whole vectors. Default: a new
    one.
    """

    def __init__(
        self,
        lanes: int,
        system: System,
        control: Control,
        n_observed: int,
        samples: Array | None = None,
    ) -> None:
        m, c = control.method, control
        # The rows of a single lane are in vectors, and rows of zeros fill the last vector. Samples
        # are written in vectors for any number of lanes.
        self.size = system.n_rows
        width = _whole_vectors(n_observed)
        rows = _whole_vectors(self.size) if lanes == 1 else max(self.size, width)
        if samples is None:
            samples = aligned(lanes, c.n_samples, width, fill=np.empty)
        self.n_observed, self.control = n_observed, control
        self.rhs, self.ints = system.right_hand_side, system.int_params
        self.params = aligned(len(system.lane_params), lanes)
        self.params[:] = system.lane_params[:, None]
        self.lanes = Lanes(
            y=aligned(rows, lanes),
            y1=aligned(rows, lanes),
            k=aligned((m.stages + 1) * rows, lanes),
            weights=aligned(m.stages, LANES),
            lane=aligned(LANE_ROWS, lanes),
            counters=np.zeros((COUNT_ROWS, lanes), dtype=np.int64),
            samples=samples,
        )
        self.lanes.counters[STATE] = IDLE
        self.method = Method(m.a, m.e, m.p, float(m.order))
        self.limits = Limits(
            rtol=float(c.rtol),
            atol=float(c.atol),
            t_end=float(c.t_end),
            max_steps=int(c.max_steps),
            start=float(c.start),
            step=float(c.step),
        )
        self.advance = stepper.advance(lanes)
        self.iterations = min(max(FIRST_WORK // (rows * lanes), 1), FIRST_STEPS)

    def put(self, m: int, y0: Array, params: Array) -> None:
        """Start a trajectory in lane ``m``."""
        lanes = self.lanes
        lanes.y[: self.size, m] = y0
        self.params[:, m] = params
        lanes.lane[:, m] = 0.0
        lanes.lane[LOG_ERROR, m] = stepper.LOG_ERROR_FLOOR
        lanes.counters[:, m] = 0
        lanes.counters[STATE, m] = FRESH
        if self.control.start <= 0.0:
            self.sampled(m)[:, 0] = y0[: self.n_observed]
            lanes.counters[NEXT_SAMPLE, m] = 1

    def sampled(self, m: int) -> Array:
        """Samples of lane ``m``, shape (n_observed, n_samples)."""
        samples: Array = self.lanes.samples[m, :, : self.n_observed].T
        return samples

    def clear(self, m: int) -> None:
        """Fill lane ``m`` with zeros, so that it computes zeros until it is used again."""
        lanes = self.lanes
        lanes.y[:, m] = lanes.y1[:, m] = lanes.k[:, m] = lanes.lane[:, m] = 0.0
        lanes.counters[STATE, m] = IDLE

    def run(self) -> float:
        """Call the compiled loop once. Returns its wall time in seconds."""
        began = time.perf_counter()
        with foreign_code():
            done = self.advance(
                self.rhs,
                self.params,
                self.ints,
                self.lanes,
                self.method,
                self.limits,
                self.size,
                self.iterations,
            )
        elapsed = time.perf_counter() - began
        if done == self.iterations:
            scale = SLICE / max(elapsed, 1e-6)
            self.iterations = int(self.iterations * min(max(scale, 0.25), 8.0)) + 1
        return elapsed

    def outcome(self, m: int, status: Status, elapsed: float) -> Outcome:
        """Return the result of the trajectory in lane ``m``, which took ``elapsed`` seconds."""
        return Outcome(
            status,
            steps=int(self.lanes.counters[ACCEPTED, m]),
            elapsed=elapsed,
            samples=self.sampled(m),
            n_sampled=int(self.lanes.counters[NEXT_SAMPLE, m]),
            y_end=self.lanes.y[: self.size, m].copy(),
        )


def _whole_vectors(n: int) -> int:
    return -(-n // LANES) * LANES


def choose_lanes(
    n_trajectories: int, n_rows: int, stages: int, n_observed: int, n_samples: int
) -> int:
    """Return 1 or `LANES`, from the number of trajectories and the memory that they need."""
    fits = LANES * _whole_vectors(n_observed) * n_samples * 8 <= SAMPLE_BYTES
    fits = fits and LANES * (stages + 3) * n_rows * 8 <= VECTOR_BYTES
    return LANES if n_trajectories >= VECTOR_TRAJECTORIES and fits else 1


def integrate(
    systems: Sequence[System],
    states: Sequence[Array] | Callable[[int], Array],
    control: Control,
    n_observed: int,
    on_end: Callable[[int, Outcome], None],
    should_stop: Callable[[], bool] | None = None,
    lanes: int | None = None,
) -> None:
    """Integrate trajectories that can share a kernel call, several at a time.

    The bits of a trajectory do not depend on the others, nor on the number of lanes.

    systems: one per trajectory, equal in right-hand side and integer parameters.
    states (n_rows,): initial states, or a function that returns the state for the number of a
        trajectory.
    n_observed: the first ``n_observed`` rows are sampled.
    on_end: called with (number, `Outcome`) as each trajectory ends, in order of ending.
    should_stop: called about ten times per second. If it returns true, `Stopped` is raised.
    lanes: 1 or `LANES`. Default: see `choose_lanes`.

    Raises Stopped: ``should_stop`` returned true.
    """
    if not systems:
        return
    initial = states if callable(states) else states.__getitem__
    rows, stages = systems[0].n_rows, control.method.stages
    width = lanes or choose_lanes(len(systems), rows, stages, n_observed, control.n_samples)
    # Only the buffer of several lanes is used again, since `choose_lanes` limits its size. The
    # samples of a single trajectory may have any size, and `simulate` returns them.
    shape = width, control.n_samples, _whole_vectors(n_observed)
    with nullcontext() if width == 1 else scratch_buffer(*shape) as samples:
        pool = LanePool(width, systems[0], control, n_observed, samples)
        _work_through(pool, systems, initial, on_end, should_stop)


def _work_through(
    pool: LanePool,
    systems: Sequence[System],
    initial: Callable[[int], Array],
    on_end: Callable[[int, Outcome], None],
    should_stop: Callable[[], bool] | None,
) -> None:
    """Keep the lanes busy until every trajectory has ended."""
    width = pool.lanes.y.shape[1]
    waiting = iter(range(len(systems)))
    holds: list[int | None] = [None] * width
    spent = np.zeros(width)
    since = np.zeros(width)

    def fill(m: int) -> None:
        number = next(waiting, None)
        holds[m] = number
        if number is None:
            pool.clear(m)
            return
        pool.put(m, initial(number), systems[number].lane_params)
        spent[m], since[m] = 0.0, time.perf_counter()

    for m in range(width):
        fill(m)
    while any(number is not None for number in holds):
        if should_stop is not None and should_stop():
            raise Stopped
        busy = [m for m in range(width) if holds[m] is not None]
        spent[busy] += pool.run() / len(busy)
        now = time.perf_counter()
        for m in busy:
            number, state = holds[m], int(pool.lanes.counters[STATE, m])
            if state == RUNNING and now - since[m] > pool.control.time_out:
                state = int(Status.TIME_OUT)
            if state == RUNNING or number is None:
                continue
            on_end(number, pool.outcome(m, Status(state), float(spent[m])))
            fill(m)
