"""One block of points: its numbers, their independence of the block, statuses, retries, stops."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from store_tools import encode_series

from chimera_hpc import fourier_features, simulate, total_variations
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.lanes import integrate as real_integrate
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.job.tables import Integrator, Keep
from chimera_hpc.measures.incoherence import local_sigma, order_parameter, range_of, sigma
from chimera_hpc.run import block as task
from chimera_hpc.run.block import DoesNotFit, run_block, warm_up
from chimera_hpc.run.initial_state import initial_state
from chimera_hpc.store.block_result import failed_block
from chimera_hpc.store.schema import (
    MISSING,
    decode_series,
    sample_times,
    scalar_labels,
)
from chimera_hpc.store.store import Store


def sweep(text="", grid='P = [9, 12]\nQ = "P"\nseeds = 3', model="topological_fhn"):
    """A sweep of short runs with further settings; keys of the integrator need no table."""
    head = f'name = "x"\nmodel = "{model}"\n[grid]\n{grid}\n'
    settings = f"t_end=60.0 features.start=30.0 {text}".split()
    keys = Integrator.model_fields
    tables = ["integrator." if word.partition("=")[0] in keys else "" for word in settings]
    return Sweep.from_toml_text(
        head, [table + word for table, word in zip(tables, settings, strict=True)]
    )


def join(results):
    """One result of several."""
    names = [f.name for f in fields(results[0]) if getattr(results[0], f.name) is not None]
    parts = {name: [getattr(r, name) for r in results] for name in names}
    return {name: np.concatenate(arrays) for name, arrays in parts.items()}


NOT_TIMES = ("status", "features", "scalars", "quality", "steps", "n_windows", "series")


def assert_same(result, expected, order=slice(None)):
    """Equal to the bit, but for the time it took."""
    for name in NOT_TIMES:
        a, b = result[name], getattr(expected, name)[order]
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes(), name


# --- what a point's numbers are -------------------------------------------------------------------


def test_numbers_are_those_of_the_library():
    s = sweep("keep.dtype=float32")
    points = s.points()
    result = run_block(s, points)
    labels = scalar_labels(sweep())
    for i, row in enumerate(points.row(i) for i in range(len(points))):
        model = build(s, row)
        u0, v0 = initial_state(s, row, model)
        run = simulate(model, u0=u0, v0=v0, t_end=60.0, t_start=30.0)
        u = run.u.astype(np.float32).astype(np.float64)  # measured as it is stored
        found = fourier_features(sample_times(s), u)
        scalars = dict(zip(labels, result.scalars[i], strict=True))
        assert result.status[i] == found.status == Status.DONE
        assert result.n_windows[i] == found.n_windows
        assert result.steps[i] == run.steps
        np.testing.assert_array_equal(result.features[i], found.as_array())
        np.testing.assert_array_equal(result.series[i], u)
        variations = [scalars[name] for name in ("V_theta", "V_a", "V_Omega")]
        assert variations == list(total_variations(found))
        assert scalars["sigma_1"] == sigma(u)
        assert scalars["sigma_2"] == sigma(run.w)
        assert scalars["std_u"] == pytest.approx(u.std(axis=0).mean(), rel=1e-13)
        assert scalars["range_u"] == range_of(u) == np.ptp(u)
        assert scalars["order_parameter"] == order_parameter(u, run.w)
        local = [scalars[f"local_sigma_{m}"] for m in range(1, 7)]
        np.testing.assert_array_equal(local, local_sigma(u, 6))
        far = np.abs(np.concatenate([run.u[-1], run.v[-1]])).max()
        assert scalars["distance"] == pytest.approx(far, rel=1e-6)


@pytest.mark.parametrize("form", ["reduced", "full"])
@pytest.mark.parametrize("ball", ["maximum", "euclidean"])
def test_distance_is_measured_from_the_centre_in_the_norm_of_the_ball(ball, form):
    options = f"centre=upper ball={ball} delta=0.1 form={form} t_end=20.0 features.start=0.0"
    s = sweep(f"{options} rtol=1e-8 atol=1e-10", "P = [5]\nQ = [0]\nseeds = 1")
    row = s.points().row(0)
    model = build(s, row)
    u0, v0 = initial_state(s, row, model)
    centre = np.repeat(model.equilibrium("upper"), [50, 250])
    norm = {"maximum": lambda x: np.abs(x).max(), "euclidean": np.linalg.norm}[ball]
    run = simulate(model, u0=u0, v0=v0, t_end=20.0, t_step=20.0, rtol=1e-9, atol=1e-12)
    start, end = (norm(np.concatenate([run.u[i], run.v[i]]) - centre) for i in (0, -1))
    assert start <= 0.1
    assert abs(end - start) > 1e-3
    distance = run_block(s, s.points()).scalars[0, scalar_labels(sweep()).index("distance")]
    assert distance == pytest.approx(end, rel=1e-4)


def test_networked_points():
    s = sweep(
        "n_nodes=60 features.n_peaks=4 features.n_overlap=2",
        "P = [20]\nseeds = 3",
        "networked_fhn",
    )
    result = run_block(s, s.points())
    assert result.status.tolist() == [Status.DONE] * 3
    assert np.isfinite(result.features[:, :4]).all()


@pytest.mark.parametrize("method", ["tsit5", "dopri5"])
def test_every_method_runs_a_block_and_they_agree(method):
    s = sweep(f"method={method} rtol=1e-8 atol=1e-10 t_end=10.0 features.start=2.0", seeds(1))
    truth = sweep("rtol=1e-9 atol=1e-12 t_end=10.0 features.start=2.0", seeds(1))
    a, b = (run_block(sweep, sweep.points()) for sweep in (s, truth))
    np.testing.assert_allclose(decode_series(a.series), decode_series(b.series), atol=2e-3)
    assert a.steps[0] != b.steps[0]


def seeds(n):
    """A grid of one cell."""
    return f"P = [9]\nQ = [9]\nseeds = {n}"


# --- kept series ----------------------------------------------------------------------------------


def signals(s):
    """The series of a sweep's points before any rounding, (T, N0) each."""
    points = s.points()
    for row in (points.row(i) for i in range(len(points))):
        model = build(s, row)
        u0, v0 = initial_state(s, row, model)
        t_end, t_start = s.integrator.t_end, s.features.start
        yield simulate(model, u0=u0, v0=v0, t_end=t_end, t_start=t_start).u


@pytest.mark.parametrize("dtype", ["int16", "float32"])
def test_kept_series_is_the_signal_in_the_type_of_the_store(dtype):
    s = sweep(f"keep.dtype={dtype}")
    kept = run_block(s, s.points()).series
    assert (kept.dtype, kept.shape) == (np.dtype(dtype), (6, 3001, 50))
    for series, u in zip(kept, signals(s), strict=True):
        np.testing.assert_array_equal(series, encode_series(u, dtype))


# Where rounding moves a maximum by a sample, features of the unrounded signal miss by 0.9 rad.
RECOMPUTED = sweep("t_end=150.0 features.start=100.0", 'P = [7, 8, 10, 13]\nQ = "P"\nseeds = 3')


def features_again(series):
    return fourier_features(sample_times(RECOMPUTED), series).as_array()


@pytest.mark.parametrize("dtype", ["int16", "float32"])
def test_features_of_the_kept_series_are_the_stored_features(dtype):
    s = RECOMPUTED.model_copy(update={"keep": Keep(dtype=dtype)})
    result = run_block(s, s.points())
    assert (result.status == Status.DONE).all()
    for kept, stored in zip(result.series, result.features, strict=True):
        np.testing.assert_array_equal(features_again(decode_series(kept)), stored)


def test_features_of_the_kept_series_read_as_float32_agree():
    # Other readers turn int16 with a scale into float32.
    result = run_block(RECOMPUTED, RECOMPUTED.points())
    for kept, stored in zip(result.series, result.features, strict=True):
        difference = features_again(kept * np.float32(1e-4)) - stored
        difference[2] = (difference[2] + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(difference).max() < 2e-3


def test_features_do_not_depend_on_which_series_are_kept():
    results = [
        run_block(s, s.points()) for s in (sweep(f"keep.series={k}") for k in ("all", "none"))
    ]
    assert results[0].features.tobytes() == results[1].features.tobytes()
    assert results[0].scalars.tobytes() == results[1].scalars.tobytes()


def test_signals_beyond_the_range_of_int16_are_refused_and_float32_holds_them():
    # u follows the cube root of the links' signal: a large b lifts it beyond 3.2767.
    settings = "b=20.0 features.steady_threshold=0.0"
    s = sweep(settings, seeds(1))
    with pytest.raises(DoesNotFit, match=r"int16 holds it up to 3\.2767 only: set keep.dtype"):
        run_block(s, s.points())
    s = sweep(f"{settings} keep.dtype=float32", seeds(1))
    result = run_block(s, s.points())
    assert result.status[0] in (Status.DONE, Status.NO_WINDOW)
    assert np.isfinite(result.series[0]).all()
    assert result.scalars[0, scalar_labels(sweep()).index("range_u")] > 2 * 3.2767


@pytest.mark.parametrize(
    ("keep", "kept"),
    [("all", [True] * 6), ("first-seed", [True, False, False] * 2), ("none", None)],
)
def test_series_are_kept_as_the_job_says(keep, kept):
    s = sweep(f"keep.series={keep}")
    series = run_block(s, s.points()).series
    if kept is None:
        assert series is None
    else:
        assert [bool((x != MISSING).all()) for x in series] == kept
        assert [bool((x == MISSING).all()) for x in series] == [not k for k in kept]


@given(st.integers(1, 300), st.integers(1, 400), st.floats(0, 0.9), st.sampled_from([1, 10, 1000]))
def test_samples_of_a_sweep_are_those_of_the_integrator(t_step, t_end, share, divisor):
    # Times that are round in decimal and not in binary.
    t_step, t_end = t_step / 1000, t_end / divisor
    start = round(share * t_end * divisor) / divisor
    assume(t_step <= t_end - start)
    text = f"n_nodes=6 t_step={t_step} t_end={t_end} features.start={start}"
    s = sweep(text, "P = [2]\nQ = [0]\nseeds = 1")
    times = sample_times(s)
    control = Control(t_end, float(times[0]), t_step)
    assert len(times) == s.n_samples == control.n_samples
    np.testing.assert_allclose(control.times, times, rtol=1e-12, atol=1e-12)


# --- a point does not see its block ---------------------------------------------------------------

MIXED_GRID = 'P = [5, 9]\nQ = "P"\norientation = [1, 2]\nb = [0.5, 1e300]\nseeds = 2'
MIXED = "t_end=12.0 features.start=4.0 features.n_peaks=4 features.n_overlap=1"


@pytest.fixture(scope="module")
def mixed():
    """A block with two rings and failing points among the others, and its result."""
    s = sweep(MIXED, MIXED_GRID)
    points = s.points()
    result = run_block(s, points)
    assert len(points) == 16
    assert {Status(code) for code in result.status} >= {Status.DONE, Status.NON_FINITE}
    return s, points, result


@pytest.mark.parametrize("size", [1, 2, 3, 7, 16])
def test_block_size_changes_no_bit(mixed, size):
    s, points, expected = mixed
    parts = [run_block(s, points[i : i + size]) for i in range(0, 16, size)]
    assert_same(join(parts), expected)


@pytest.mark.parametrize("lanes", [1, LANES])
def test_number_of_lanes_changes_no_bit(mixed, lanes):
    s, points, expected = mixed
    assert_same(join([run_block(s, points, lanes=lanes)]), expected)


@pytest.mark.parametrize("seed", range(3))
def test_order_of_the_points_changes_no_bit(mixed, seed):
    s, points, expected = mixed
    order = np.random.default_rng(seed).permutation(16)
    assert_same(join([run_block(s, points[order])]), expected, order)


def test_a_point_twice_in_a_block_has_the_same_bits_twice(mixed):
    s, points, expected = mixed
    order = np.array([3, 0, 3, 3])
    assert_same(join([run_block(s, points[order])]), expected, order)


# --- statuses -------------------------------------------------------------------------------------


def test_steady_and_oscillating_points_of_the_paper():
    # No run oscillates at P = 2; at P = 3 some do.
    s = sweep(
        "t_end=1000.0 features.start=950.0 keep.series=none", 'P = [2, 3]\nQ = "P"\nseeds = 4'
    )
    result = run_block(s, s.points())
    two, three = result.status[:4], result.status[4:]
    assert (two == Status.STEADY).all()
    assert set(three) == {Status.STEADY, Status.DONE}
    steady = result.status == Status.STEADY
    std_u = result.scalars[:, scalar_labels(sweep()).index("std_u")]
    assert (std_u[steady] < 1e-2).all()
    assert (std_u[~steady] > 0.1).all()
    assert np.isnan(result.features[steady]).all()
    assert np.isfinite(result.features[~steady]).all()
    assert (result.n_windows > 0).tolist() == (~steady).tolist()


def test_interval_with_too_few_maxima_has_no_window():
    s = sweep("features.start=58.0", seeds(2))
    result = run_block(s, s.points())
    assert (result.status == Status.NO_WINDOW).all()
    assert np.isnan(result.features).all()
    assert np.isnan(result.scalars[:, :3]).all()
    assert np.isfinite(result.scalars[:, 3:]).all()
    assert (result.n_windows == 0).all()
    assert (result.series != MISSING).all()


@pytest.mark.parametrize(
    ("text", "status"),
    [
        ("b=1e300", Status.NON_FINITE),
        ("b=1e100", Status.STEP_TOO_SMALL),
        ("epsilon=1e-9 max_steps=2000", Status.STEP_BUDGET),
        ("epsilon=1e-9 time_out=0.2", Status.TIME_OUT),
    ],
)
def test_failure_leaves_a_status_and_no_numbers(text, status):
    s = sweep(text, seeds(2))
    result = run_block(s, s.points())
    assert (result.status == status).all()
    assert np.isnan(result.features).all()
    assert np.isnan(result.scalars).all()
    assert (result.series == MISSING).all()
    assert (result.n_windows == 0).all()


def test_points_that_could_not_be_computed():
    s = sweep()
    result = failed_block(s, s.points()[:4], Status.OUT_OF_MEMORY)
    assert result.status.tolist() == [Status.OUT_OF_MEMORY] * 4
    assert np.isnan(result.features).all()
    assert result.features.shape == (4, 8, 50)
    assert np.isnan(result.scalars).all()
    assert (result.series == MISSING).all()


def test_time_and_steps_are_counted(mixed):
    _, _, result = mixed
    done = result.status == Status.DONE
    assert (result.elapsed_us[done] > 0).all()
    assert (result.steps[done] > 100).all()


# --- retries --------------------------------------------------------------------------------------


@pytest.fixture
def tries(monkeypatch):
    """Record each call of the integrator; `fails` chooses the outcomes that are made failures.

    Returns the list of (rtol, atol, number of trajectories) and the dictionary to choose with:
    number of the call -> (numbers of trajectories, status).
    """
    calls, fails = [], {}

    def integrate(systems, states, control, n_rows, on_end, should_stop, lanes):
        numbers, status = fails.get(len(calls), ((), None))
        calls.append((control.rtol, control.atol, len(systems)))

        def spoil(number, outcome):
            on_end(number, replace(outcome, status=status) if number in numbers else outcome)

        real_integrate(systems, states, control, n_rows, spoil, should_stop, lanes)

    monkeypatch.setattr(task, "integrate", integrate)
    return calls, fails


@pytest.mark.parametrize("status", [Status.NON_FINITE, Status.STEP_TOO_SMALL])
def test_a_failed_run_is_tried_again_with_tighter_tolerances(tries, status):
    calls, fails = tries
    s = sweep("", seeds(4))
    tight = sweep("rtol=1e-4 atol=1e-7", seeds(4))
    plain, expected = (run_block(x, x.points()) for x in (s, tight))
    calls.clear()
    fails[0] = ((1, 3), status)
    ended = []
    result = run_block(s, s.points(), on_point=lambda *end: ended.append(end))
    assert calls == [(1e-3, 1e-6, 4), (pytest.approx(1e-4), pytest.approx(1e-7), 2)]
    assert (result.status == Status.DONE).all()
    np.testing.assert_array_equal(result.features[[0, 2]], plain.features[[0, 2]])
    np.testing.assert_allclose(result.features[[1, 3]], expected.features[[1, 3]], rtol=1e-9)
    # Both tries cost steps; a point ends once.
    np.testing.assert_array_equal(result.steps[[1, 3]], (plain.steps + expected.steps)[[1, 3]])
    assert sorted(ended) == [(i, Status.DONE) for i in range(4)]


def test_the_last_try_s_failure_is_the_result(tries):
    calls, _ = tries
    s = sweep("b=1e300 run.attempts=3 run.tighten=0.5", seeds(2))
    ended = []
    result = run_block(s, s.points(), on_point=lambda *end: ended.append(end))
    assert [call[0] for call in calls] == [1e-3, 5e-4, 2.5e-4]
    assert (result.status == Status.NON_FINITE).all()
    assert sorted(ended) == [(0, Status.NON_FINITE), (1, Status.NON_FINITE)]


@pytest.mark.parametrize("status", [Status.STEP_BUDGET, Status.TIME_OUT])
def test_a_run_that_was_too_long_is_not_made_longer(tries, status):
    calls, fails = tries
    fails[0] = ((0,), status)
    s = sweep("", seeds(2))
    result = run_block(s, s.points())
    assert len(calls) == 1
    assert result.status.tolist() == [status, Status.DONE]


# --- stops ----------------------------------------------------------------------------------------


def test_stop_returns_what_is_done_and_leaves_the_rest_for_later():
    s = sweep("", seeds(6))
    expected = run_block(s, s.points())
    ended = []
    result = run_block(
        s,
        s.points(),
        should_stop=lambda: len(ended) >= 2,
        on_point=lambda i, status: ended.append(i),
        lanes=1,
    )
    assert ended == [0, 1]
    assert result.status.tolist() == [Status.DONE] * 2 + [Status.NEVER] * 4
    assert result.features[:2].tobytes() == expected.features[:2].tobytes()
    assert np.isnan(result.features[2:]).all()
    assert (result.series[2:] == MISSING).all()


def test_stop_at_once_computes_nothing():
    s = sweep("", seeds(3))
    result = run_block(s, s.points(), should_stop=lambda: True)
    assert (result.status == Status.NEVER).all()


def test_a_stop_before_a_second_try_leaves_the_point_for_later(tries):
    # Its first failure would otherwise stand in the store though an undisturbed run has none.
    calls, fails = tries
    fails[0] = ((1,), Status.NON_FINITE)
    s = sweep("", seeds(3))
    result = run_block(s, s.points(), should_stop=lambda: len(calls) > 1, lanes=1)
    assert result.status.tolist() == [Status.DONE, Status.NEVER, Status.DONE]


# --- imports and compilation ----------------------------------------------------------------------


def run_python(code):
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout


def test_science_of_a_task_imports_neither_dask_nor_zarr():
    code = "import sys, chimera_hpc.run.block; print(*sys.modules)"
    loaded = {name.partition(".")[0] for name in run_python(code).split()}
    assert "chimera_hpc" in loaded
    assert not loaded & {"dask", "distributed", "zarr", "xarray", "sklearn", "matplotlib", "bokeh"}


def test_after_warm_up_a_block_compiles_nothing(monkeypatch):
    s = sweep("features.refine=sine-fit features.window_reference=own")
    warm_up(s, s.points())
    compiled = []
    monkeypatch.setattr(
        "numba.core.dispatcher._FunctionCompiler.compile",
        lambda self, args, return_type: compiled.append(self.py_func) or pytest.fail("compiles"),
    )
    run_block(s, s.points())
    assert compiled == []


def test_store_of_a_removed_method_is_read_and_not_computed(tmp_path):
    data = sweep().to_dict()
    data["integrator"]["method"] = "verner6"
    old = Sweep.from_dict(data)
    Store.plan(tmp_path / "store.zarr", old)
    assert Store.open(tmp_path / "store.zarr").sweep == old
    for compute in (run_block, warm_up):
        with pytest.raises(BadInput, match=r'"verner6" was removed in version 0\.2: use "tsit5"'):
            compute(old, old.points()[:1])
