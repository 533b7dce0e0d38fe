"""The library's door: what `simulate` returns, samples and refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from chimera_hpc import NetworkedFHN, Topology, simulate
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.models.topological_fhn import TopologicalFHN

RING = Topology.ring(8, 3).reorient_node(0, 2)
START = {"u0": np.linspace(-1.0, 1.0, 8), "v0": np.linspace(-0.2, 0.2, 24)}


@pytest.mark.parametrize("form", ["reduced", "full"])
def test_shapes_and_start(form):
    run = simulate(RING, **START, t_end=1.0, t_step=0.25, form=form)
    np.testing.assert_array_equal(run.t, [0.0, 0.25, 0.5, 0.75, 1.0])
    assert (run.u.shape, run.w.shape, run.v.shape) == ((5, 8), (5, 8), (5, 24))
    np.testing.assert_array_equal(run.u[0], START["u0"])
    np.testing.assert_allclose(run.v[0], START["v0"], atol=1e-12)
    np.testing.assert_allclose(run.w[0], RING.incidence @ START["v0"], atol=1e-12)
    assert run.status is Status.DONE
    assert run.steps > 5


def test_late_start_of_the_samples_is_a_part_of_the_whole():
    whole = simulate(RING, **START, t_end=2.0, t_step=0.125)
    part = simulate(RING, **START, t_end=2.0, t_step=0.125, t_start=1.5)
    np.testing.assert_array_equal(part.t, [1.5, 1.625, 1.75, 1.875, 2.0])
    np.testing.assert_array_equal(part.u, whole.u[12:])
    np.testing.assert_array_equal(part.v, whole.v[12:])
    end = simulate(RING, **START, t_end=2.0, t_step=0.125, t_start=2.0)
    np.testing.assert_array_equal(end.u, whole.u[-1:])


def test_same_input_gives_the_same_bits_twice():
    first, second = (simulate(RING, **START, t_end=5.0) for _ in range(2))
    assert first.u.tobytes() == second.u.tobytes()
    assert first.steps == second.steps


def test_trajectories_do_not_share_memory():
    run = simulate(RING, **START, t_end=1.0)
    before = run.u.copy()
    simulate(RING, u0=-START["u0"], v0=START["v0"], t_end=1.0)
    np.testing.assert_array_equal(run.u, before)


def test_input_arrays_are_left_alone_and_may_be_lists():
    u0, v0 = START["u0"].copy(), START["v0"].copy()
    run = simulate(RING, u0=u0, v0=v0, t_end=1.0)
    np.testing.assert_array_equal(u0, START["u0"])
    np.testing.assert_array_equal(v0, START["v0"])
    other = simulate(RING, u0=u0.tolist(), v0=v0.tolist(), t_end=1.0)
    np.testing.assert_array_equal(other.u, run.u)


def test_model_with_its_own_parameters_ignores_those_of_the_call():
    model = TopologicalFHN(RING, epsilon=0.1, b=0.2, c=-0.3, form="full")
    run = simulate(model, **START, t_end=1.0, epsilon=0.7, b=9.0, form="reduced")
    same = simulate(RING, **START, t_end=1.0, epsilon=0.1, b=0.2, c=-0.3, form="full")
    np.testing.assert_array_equal(run.u, same.u)


def test_defaults_are_those_of_the_paper():
    explicit = {"epsilon": 0.05, "b": 0.5, "c": -0.01, "rtol": 1e-3, "atol": 1e-6}
    a = simulate(RING, **START, t_end=1.0)
    b = simulate(RING, **START, t_end=1.0, t_step=0.01, method="tsit5", **explicit)
    np.testing.assert_array_equal(a.u, b.u)


def test_methods_agree():
    options = {"t_end": 2.0, "t_step": 0.1, "rtol": 1e-9, "atol": 1e-12}
    runs = [simulate(RING, **START, **options, method=m) for m in ("tsit5", "dopri5")]
    assert len({run.steps for run in runs}) == 2
    for run in runs[1:]:
        np.testing.assert_allclose(run.u, runs[0].u, atol=1e-7)


def test_networked_model():
    model = NetworkedFHN(n_nodes=10, half_degree=3)
    run = simulate(model, u0=np.linspace(-1, 1, 10), v0=np.zeros(10), t_end=1.0, t_step=0.5)
    assert (run.u.shape, run.w.shape, run.v.shape) == ((3, 10),) * 3


@pytest.mark.parametrize("form", ["reduced", "full"])
def test_samples_that_were_not_reached_are_nan(form):
    run = simulate(RING, **START, t_end=50.0, t_step=0.01, max_steps=60, form=form)
    reached = np.isfinite(run.u).all(axis=1)
    assert run.status is Status.STEP_BUDGET
    assert run.steps <= 60
    assert 2 < reached.sum() < len(run.t)
    assert reached[: reached.sum()].all()
    whole = simulate(RING, **START, t_end=50.0, t_step=0.01, form=form)
    np.testing.assert_array_equal(run.u[reached], whole.u[reached])
    for array in (run.u, run.w, run.v):
        assert np.isfinite(array[reached]).all()
        assert np.isnan(array[~reached]).all()


def test_time_out():
    run = simulate(RING, **START, t_end=1e4, t_step=1.0, epsilon=1e-6, time_out=0.3)
    assert run.status is Status.TIME_OUT
    assert np.isnan(run.u[-1]).all()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"u0": np.zeros(7)}, "u0 has shape (7,): needed is (8,)"),
        ({"v0": np.zeros((24, 1))}, "v0 has shape (24, 1): needed is (24,)"),
        ({"u0": np.full(8, np.nan)}, "u0 holds values that are not finite"),
        ({"v0": np.full(24, np.inf)}, "v0 holds values that are not finite"),
        ({"epsilon": 0.0}, "epsilon = 0.0"),
        ({"epsilon": -0.1}, "epsilon = -0.1"),
        ({"epsilon": math.nan}, "epsilon = nan"),
        ({"epsilon": math.inf}, "epsilon = inf"),
        ({"b": math.inf}, "epsilon = 0.05, b = inf"),
        ({"c": math.nan}, "epsilon = 0.05, b = 0.5, c = nan"),
        ({"form": "ful"}, "form = 'ful': allowed are reduced, full"),
        ({"method": "rk4"}, "method = 'rk4': allowed are tsit5, dopri5"),
        ({"method": "verner6"}, 'method "verner6" was removed in version 0.2: use "tsit5"'),
        ({"t_end": 0.0}, "t_start = 0.0, t_end = 0.0"),
        ({"t_end": math.inf}, "t_start = 0.0, t_end = inf"),
        ({"t_end": math.nan}, "t_start = 0.0, t_end = nan"),
        ({"t_start": -1.0}, "t_start = -1.0"),
        ({"t_start": 2.0}, "t_start = 2.0, t_end = 1.0"),
        ({"t_step": 0.0}, "t_start = 0.0, t_end = 1.0, t_step = 0.0"),
        ({"t_step": math.nan}, "t_start = 0.0, t_end = 1.0, t_step = nan"),
        ({"t_step": math.inf}, "t_start = 0.0, t_end = 1.0, t_step = inf"),
        ({"rtol": 0.0}, "rtol = 0.0, atol = 1e-06: both must be above 0"),
        ({"atol": -1.0}, "rtol = 0.001, atol = -1.0: both must be above 0"),
        ({"max_steps": 0}, "max_steps = 0, time_out = inf: at least 1, and above 0, are needed"),
        ({"time_out": 0.0}, "max_steps = 10000000, time_out = 0.0: at least 1"),
    ],
)
def test_bad_input_is_refused_in_one_line(wrong, message):
    with pytest.raises(BadInput) as caught:
        simulate(RING, **{**START, "t_end": 1.0, **wrong})
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)
