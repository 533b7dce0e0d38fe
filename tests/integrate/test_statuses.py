"""Every way in which a trajectory can end, provoked for real, beside one that ends well."""

from __future__ import annotations

import time

import numpy as np
import pytest
from kernel_tools import System, powers, run_all

from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.simd import LANES

ONE = np.ones(2)


def power_law(rate, exponent):
    """y' = rate * y**exponent from y = 1."""
    return System(powers, np.array([rate, exponent], dtype=float), 2)


DECAY = power_law(-1.0, 1.0)
# Passes through no zero: the sign of the slope changes there, and the step with it, without end.
ENDLESS = power_law(-1.0, -1.0)

FAILURES = {
    "grows beyond the largest number": (power_law(800.0, 1.0), Status.NON_FINITE),
    "root of a negative number": (power_law(-1.0, 0.5), Status.NON_FINITE),
    "parameter that is NaN": (power_law(np.nan, 1.0), Status.NON_FINITE),
    "infinite at a finite time": (power_law(1.0, 2.0), Status.STEP_TOO_SMALL),
    "infinite slope": (power_law(-1.0, -3.0), Status.STEP_TOO_SMALL),
    "needs too many steps": (ENDLESS, Status.STEP_BUDGET),
}
failures = pytest.mark.parametrize(("system", "status"), FAILURES.values(), ids=FAILURES)


@pytest.mark.parametrize("lanes", [1, LANES])
@failures
def test_failure_has_its_status_and_its_neighbours_finish(system, status, lanes):
    control = Control(3.0, 0.0, 0.1, max_steps=3000)
    runs = run_all([DECAY, system, DECAY], [ONE, ONE, ONE], control, lanes=lanes)
    (alone,) = run_all([DECAY], [ONE], control, lanes=1)
    assert [run.outcome.status for run in runs] == [Status.DONE, status, Status.DONE]
    assert runs[0].bits == runs[2].bits == alone.bits
    np.testing.assert_allclose(alone.samples[0], np.exp(-control.times), rtol=2e-3)


@failures
def test_samples_of_a_failure_end_where_it_failed(system, status):
    control = Control(3.0, 0.0, 0.1, max_steps=3000)
    (run,) = run_all([system], [ONE], control)
    assert run.samples.shape == (2, run.outcome.n_sampled)
    assert run.outcome.n_sampled < control.n_samples
    assert np.isfinite(run.samples).all()
    assert np.isfinite(run.outcome.y_end).all()


def test_failure_at_once_is_told_after_few_steps():
    nan = FAILURES["parameter that is NaN"][0]
    (run,) = run_all([nan], [ONE], Control(3.0, 0.0, 0.1, max_steps=50))
    assert run.outcome.status == Status.NON_FINITE


def test_last_step_ends_at_the_end_wherever_that_is():
    # y' = 1 has no error: steps grow tenfold, so that ends lie anywhere within the last one.
    for t_end in np.geomspace(1.0, 12.0, 500):
        (run,) = run_all([power_law(1.0, 0.0)], [ONE], Control(t_end, 0.0, t_end))
        np.testing.assert_allclose(run.outcome.y_end, 1.0 + t_end, rtol=1e-12)


def test_blow_up_is_followed_to_its_time():
    # y' = y**2 from 1 is 1 / (1 - t): infinite at t = 1.
    control = Control(3.0, 0.0, 0.1, rtol=1e-9, atol=1e-9)
    (run,) = run_all([power_law(1.0, 2.0)], [ONE], control)
    assert run.outcome.n_sampled in (10, 11)
    np.testing.assert_allclose(run.samples[0, :10], 1.0 / (1.0 - control.times[:10]), rtol=1e-6)


@pytest.mark.parametrize("lanes", [1, LANES])
def test_time_out_ends_only_the_run_that_takes_too_long(lanes):
    control = Control(3.0, 0.0, 0.1, max_steps=10**9, time_out=0.4)
    began = time.perf_counter()
    systems = [DECAY, ENDLESS, *[DECAY] * (2 * LANES)]
    runs = run_all(systems, [ONE] * len(systems), control, lanes=lanes)
    waited = time.perf_counter() - began
    assert 0.4 < waited < 0.4 + 2.0
    statuses = [run.outcome.status for run in runs]
    assert statuses.pop(1) == Status.TIME_OUT
    assert set(statuses) == {Status.DONE}
    assert runs[1].outcome.elapsed > 0.1


def test_time_out_is_of_wall_time_however_many_lanes_share_it():
    control = Control(3.0, 0.0, 0.1, max_steps=10**9, time_out=0.4)
    began = time.perf_counter()
    runs = run_all([ENDLESS] * LANES, [ONE] * LANES, control, lanes=LANES)
    assert time.perf_counter() - began < 0.4 * LANES / 2
    assert {run.outcome.status for run in runs} == {Status.TIME_OUT}
    # The time is shared out among the lanes.
    assert sum(run.outcome.elapsed for run in runs) < 0.4 * LANES / 2


def test_late_blow_up_ends_by_its_step_size_too():
    # The smallest step is relative to the time: 1e-14 would no longer change t = 1000.
    control = Control(2000.0, 0.0, 100.0, max_steps=10**6)
    late = System(powers, np.array([1e-3, 2.0]), 2)
    (run,) = run_all([late], [ONE], control)
    assert run.outcome.status == Status.STEP_TOO_SMALL
    assert run.outcome.n_sampled == 10
