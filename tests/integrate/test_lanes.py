"""Lane management: every trajectory once, stop signals, slices of time, sampling times, memory."""

from __future__ import annotations

import time
import tracemalloc

import numpy as np
import pytest
from kernel_tools import System, powers, run_all

from chimera_hpc.base.status import Status
from chimera_hpc.integrate import lane_rows as K
from chimera_hpc.integrate import stepper
from chimera_hpc.integrate.lanes import (
    SAMPLE_BYTES,
    SLICE,
    VECTOR_BYTES,
    Control,
    LanePool,
    Stopped,
    choose_lanes,
    integrate,
)
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology

DECAY = System(powers, np.array([-1.0, 1.0]), 2)
CONTROL = Control(1.0, 0.0, 0.1)


def stiff():
    """A ring that takes minutes, and its state."""
    model = TopologicalFHN(Topology.ring(50, 12).reorient_node(0, 12), epsilon=1e-6)
    return model, np.full(model.n_rows, 0.1)


@pytest.mark.parametrize("lanes", [1, LANES])
@pytest.mark.parametrize("n", [1, 2, LANES - 1, LANES, LANES + 1, 3 * LANES + 2])
def test_every_trajectory_ends_once_with_its_own_result(n, lanes):
    starts = [np.array([1.0 + i, -1.0 - i]) for i in range(n)]
    runs = run_all([DECAY] * n, starts, CONTROL, lanes=lanes)
    assert len(runs) == n
    for y0, run in zip(starts, runs, strict=True):
        np.testing.assert_array_equal(run.samples[:, 0], y0)
        np.testing.assert_allclose(run.outcome.y_end, y0 * np.exp(-1.0), rtol=1e-3)


def test_nothing_to_do_is_done_at_once():
    integrate([], [], CONTROL, 2, lambda *_: pytest.fail("nothing can end"))


def test_only_the_observed_rows_are_sampled():
    (run,) = run_all([DECAY], [np.array([1.0, 2.0])], CONTROL, n_observed=1)
    assert run.samples.shape == (1, 11)
    assert run.outcome.y_end.shape == (2,)


def test_states_may_be_made_when_they_are_needed():
    asked = []

    def state(number):
        asked.append(number)
        return np.array([1.0 + number, 1.0])

    runs = run_all([DECAY] * 3, state, CONTROL, lanes=1)
    assert asked == [0, 1, 2]
    assert [run.samples[0, 0] for run in runs] == [1.0, 2.0, 3.0]


def test_stop_signal_stops_before_the_next_call_of_the_loop():
    ended, asked = [], []

    def should_stop():
        asked.append(len(ended))
        return len(ended) >= 2

    with pytest.raises(Stopped):
        integrate(
            [DECAY] * 5, [np.ones(2)] * 5, CONTROL, 2, lambda i, _: ended.append(i), should_stop, 1
        )
    assert ended == [0, 1]
    assert asked[-1] == 2


@pytest.mark.parametrize("lanes", [1, LANES])
def test_python_is_reached_every_half_second_of_work(lanes):
    model, y0 = stiff()
    moments = []

    def should_stop():
        moments.append(time.thread_time())
        return moments[-1] - moments[0] > 1.5

    with pytest.raises(Stopped):
        integrate([model] * lanes, [y0] * lanes, Control(1e3, 0.0, 0.01), 50, print, should_stop)
    slices = np.diff(moments)
    assert slices.max() < 0.5
    # Not by coming back all the time either: the slices settle at what is aimed at.
    assert np.median(slices[3:]) > SLICE / 10


def test_first_call_of_a_large_system_is_short_too():
    # 100,000 numbers in a lane; nothing is known about their speed before the first call.
    model = TopologicalFHN(Topology.ring(500, 200), form="full")
    pool = LanePool(LANES, model, Control(1e3, 0.0, 1e3), 500)
    for lane in range(LANES):
        pool.put(lane, np.full(model.n_rows, 0.1), model.lane_params)
    began = time.thread_time()
    pool.run()
    assert time.thread_time() - began < 0.5


def test_loop_allocates_nothing():
    model, y0 = stiff()
    pool = LanePool(LANES, model, Control(0.01, 0.0, 1e-6), 50)
    for lane in range(LANES):
        pool.put(lane, y0, model.lane_params)
    pool.run()
    tracemalloc.start()
    for _ in range(20):
        pool.iterations = 20
        pool.run()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert pool.lanes.counters[K.TRIED].min() >= 400
    assert pool.lanes.counters[K.NEXT_SAMPLE].min() > 1
    assert peak < 20_000  # bytes; the state of all lanes has 6,400, its samples 32 MB


def test_empty_lanes_stay_at_zero():
    model = TopologicalFHN(Topology.ring(9, 3).reorient_node(0, 3))
    pool = LanePool(LANES, model, Control(1.0, 0.0, 0.1), 9)
    pool.put(2, np.full(18, 0.1), model.lane_params)
    while pool.lanes.counters[K.STATE, 2] in (K.FRESH, K.RUNNING):
        pool.run()
    others = [lane for lane in range(LANES) if lane != 2]
    assert pool.lanes.counters[K.STATE, 2] == Status.DONE
    assert not pool.lanes.y[:, others].any()
    assert (pool.lanes.counters[K.STATE, others] == K.IDLE).all()


def test_cleared_lane_forgets_everything():
    pool = LanePool(LANES, DECAY, CONTROL, 2)
    pool.put(3, np.array([np.nan, 1.0]), DECAY.lane_params)
    while pool.lanes.counters[K.STATE, 3] in (K.FRESH, K.RUNNING):
        pool.run()
    assert pool.lanes.counters[K.STATE, 3] == Status.NON_FINITE
    pool.clear(3)
    for array in (pool.lanes.y, pool.lanes.y1, pool.lanes.k, pool.lanes.lane):
        assert not array[:, 3].any()


def test_no_other_number_of_lanes_is_compiled():
    with pytest.raises(ValueError, match="1 and 8 lanes, not 4"):
        stepper.advance(4)


def test_lanes_follow_the_work_and_the_memory():
    assert [choose_lanes(n, 100, 7, 50, 5001) for n in (1, 2, 3, 8)] == [1, 1, LANES, LANES]
    most = SAMPLE_BYTES // (8 * LANES * 56)  # rows of samples are whole vectors
    assert [choose_lanes(8, 100, 7, 50, n) for n in (most, most + 1)] == [LANES, 1]
    most = VECTOR_BYTES // (8 * LANES * 10)
    assert [choose_lanes(8, n, 7, 50, 10) for n in (most, most + 1)] == [LANES, 1]


@pytest.mark.parametrize(
    ("t_end", "start", "step", "times"),
    [
        (1.0, 0.0, 0.25, [0.0, 0.25, 0.5, 0.75, 1.0]),
        (1.0, 0.5, 0.3, [0.5, 0.8]),
        (1.0, 1.0, 0.3, [1.0]),
        (0.3, 0.0, 0.1, [0.0, 0.1, 0.2, 0.3]),  # 3 * 0.1 is a hair above 0.3
    ],
)
def test_sampling_times(t_end, start, step, times):
    control = Control(t_end, start, step)
    assert control.times == pytest.approx(times)
    assert control.times[-1] <= t_end
    assert len(control.times) == control.n_samples
    (run,) = run_all([DECAY], [np.ones(2)], control)
    assert run.outcome.n_sampled == len(times)
    np.testing.assert_allclose(run.samples[0], np.exp(-control.times), rtol=1e-3)


@pytest.mark.parametrize("t_end", [1e-9, 1e-5, 0.1, 7.0, 1e4])
def test_last_step_ends_at_the_end(t_end):
    control = Control(t_end, 0.0, t_end / 7)
    pool = LanePool(1, DECAY, control, 2)
    pool.put(0, np.ones(2), DECAY.lane_params)
    while pool.lanes.counters[K.STATE, 0] in (K.FRESH, K.RUNNING):
        pool.run()
    assert pool.lanes.lane[K.TIME, 0] == t_end
    assert pool.lanes.counters[K.STATE, 0] == Status.DONE
    assert pool.lanes.counters[K.NEXT_SAMPLE, 0] == 8


@pytest.mark.parametrize("lanes", [1, LANES])
def test_times_of_all_trajectories_add_up_to_no_more_than_the_wall_time(lanes):
    """Trajectories follow one another in a lane, and each begins at zero."""
    control = Control(200.0, 0.0, 1.0, rtol=1e-8)
    began = time.perf_counter()
    runs = run_all([DECAY] * 40, [np.array([1.0, 1.0])] * 40, control, lanes=lanes)
    wall = time.perf_counter() - began
    spent = [run.outcome.elapsed for run in runs]
    assert min(spent) > 0.0
    assert sum(spent) <= wall
