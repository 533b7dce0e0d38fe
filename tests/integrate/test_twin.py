"""The compiled loop against a plain NumPy integrator with the same formulas, bit for bit."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from kernel_tools import METHODS, run_all

from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology


def python_function(model):
    """The compiled right-hand side as a function of one state."""

    def f(y):
        dy = np.empty((len(y), 1))
        params = np.ascontiguousarray(model.lane_params[:, None])
        model.right_hand_side(np.ascontiguousarray(y[:, None]), dy, params, model.int_params)
        return dy[:, 0]

    return f


def models():
    topology = Topology.ring(9, 3).reorient_node(0, 2)
    yield "reduced", TopologicalFHN(topology)
    yield "full", TopologicalFHN(topology, form="full")
    yield "networked", NetworkedFHN(n_nodes=11, half_degree=3)


MODELS = dict(models())


@pytest.mark.parametrize("lanes", [1, LANES])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_loop_equals_the_plain_integrator_bit_for_bit(model, method, lanes):
    y0 = np.random.default_rng(1).uniform(-0.1, 0.1, model.n_rows)
    control = Control(3.0, 0.0, 0.0173, rtol=1e-3, atol=1e-6, method=METHODS[method])
    (run,) = run_all([model], [y0], control, lanes=lanes)
    samples, y_end, accepted, tried, t = naive.runge_kutta(
        python_function(model), y0, METHODS[method], 3.0, control.times, 1e-3, 1e-6
    )
    assert t == 3.0
    assert tried > accepted  # a rejected step takes part
    assert (run.outcome.status, run.outcome.steps) == (Status.DONE, accepted)
    np.testing.assert_array_equal(run.outcome.y_end, y_end)
    np.testing.assert_array_equal(run.samples, samples.T)


def test_loop_equals_the_plain_integrator_when_samples_begin_late():
    model = MODELS["reduced"]
    y0 = np.random.default_rng(2).uniform(-0.1, 0.1, model.n_rows)
    control = Control(2.0, 1.1, 0.3)
    (run,) = run_all([model], [y0], control)
    samples, *_ = naive.runge_kutta(
        python_function(model), y0, METHODS["tsit5"], 2.0, control.times, 1e-3, 1e-6
    )
    assert control.times.tolist() == pytest.approx([1.1, 1.4, 1.7, 2.0])
    np.testing.assert_array_equal(run.samples, samples.T)


def test_budget_counts_tried_steps():
    model = MODELS["reduced"]
    y0 = np.random.default_rng(3).uniform(-0.1, 0.1, model.n_rows)
    control = Control(30.0, 0.0, 0.1, max_steps=157)
    (run,) = run_all([model], [y0], control)
    samples, y_end, accepted, tried, t = naive.runge_kutta(
        python_function(model), y0, METHODS["tsit5"], 30.0, control.times, 1e-3, 1e-6, 157
    )
    assert tried == 157 > accepted
    assert t < 30.0
    assert (run.outcome.status, run.outcome.steps) == (Status.STEP_BUDGET, accepted)
    np.testing.assert_array_equal(run.outcome.y_end, y_end)
    np.testing.assert_array_equal(run.samples, samples.T)
