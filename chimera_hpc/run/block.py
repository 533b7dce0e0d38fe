"""The computation of one block: points in, arrays out. A pure function, without Dask and Zarr.

The arrays of a point depend on the point and on the code, not on its neighbours in the block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.foreign import foreign_code
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control, Outcome, Stopped, integrate
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.models import build
from chimera_hpc.job.registry import measures, method
from chimera_hpc.measures.fourier import NodeFeatures, measure_signals
from chimera_hpc.measures.measure import Measure, MeasuredRun
from chimera_hpc.measures.quality import quality
from chimera_hpc.measures.series import by_node, quantise, restore, round_to, turn_in_place
from chimera_hpc.models.network_model import PhaseModel
from chimera_hpc.models.protocol import Model
from chimera_hpc.network.sweep_network import pairs_of
from chimera_hpc.run.initial_state import initial_state
from chimera_hpc.run.watchdog import watchdog
from chimera_hpc.store.block_result import BlockResult, empty_result
from chimera_hpc.store.schema import MISSING, SCALE, sample_times, series_mask

Array = NDArray[np.float64]

OnSignals = Callable[[int, NDArray[Any], Array], None]
_RETRIED = (Status.NON_FINITE, Status.STEP_TOO_SMALL)


def run_block(
    sweep: Sweep,
    points: Points,
    *,
    should_stop: Callable[[], bool] | None = None,
    on_point: Callable[[int, Status], None] | None = None,
    on_signals: OnSignals | None = None,
    lanes: int | None = None,
    nudge: float = 0.0,
    starts: Array | None = None,
) -> BlockResult:
    """Integrate the points and measure their series.

    A run that becomes non-finite, or whose steps become too small, is tried again with both
    tolerances multiplied by ``run.tighten``, up to ``run.attempts`` tries in all.

    points: any points of the sweep.
    should_stop: asked about ten times a second; when true, the result is returned as far as it has
        come.
    on_point: called with (index, status) as each point ends.
    on_signals: called with (index, u, w) as each point ends: u (T, N) as a store keeps it and
        w (N, T), missing after the end of a run. They are buffers: copy what is to be kept.
    lanes: lanes of the stepping loop; chosen from the work by default.
    nudge: how far initial states are moved (see `initial_state`); 0 for a sweep's own points.
    starts (n, variables): states, u then v, in place of the points' own initial states, as
        `Store.starts` gives them for chains; NaN where a point has its own.
    """
    watchdog.watch(sweep)
    block = _Block(sweep, points, on_signals, nudge, starts)
    with suppress(Stopped):
        for rows in _lane_groups(block.models):
            factor = 1.0
            for left in reversed(range(sweep.run.attempts)):
                rows = block.integrate(rows, factor, left > 0, should_stop, on_point, lanes)
                factor *= sweep.run.tighten
    return block.result


def _lane_groups(models: list[Model]) -> Iterator[list[int]]:
    groups: dict[tuple[Any, ...], list[int]] = {}
    for row, model in enumerate(models):
        groups.setdefault(model.lane_group, []).append(row)
    yield from groups.values()


def store_as(u: Array, stored: NDArray[Any]) -> bool:
    """Write a signal (N, T) as a store keeps it, (T, N); tell if every value fits."""
    if stored.dtype == np.int16:
        return not quantise(u, SCALE, MISSING, stored)
    with np.errstate(over="ignore"):  # what does not fit is found by `_misfit`
        stored[:] = u.T
    return True


def as_measured(u: Array, w: Array, stored: NDArray[Any], fits: bool) -> tuple[Array, Array]:
    """Return u as the store gives it back, and w, both (N, T) with contiguous rows.

    Features are measured on the stored values. Otherwise, when they are recomputed from the store,
    a maximum could move between two nearly equal samples, and its window with it. Values beyond the
    range of int16, which the store does not keep, are rounded alike.

    stored (T, N), fits: what `store_as` made of u. The memory of u and w is used again, if it can
    be: a long run has no other of this size.
    """
    room = turn_in_place(u, w) if fits else None
    back, turned = room or (np.empty(u.shape), by_node(w, np.empty(w.shape)))
    if stored.dtype != np.int16:
        back[:] = stored.T
    elif fits:
        restore(stored, SCALE, back)
    else:
        round_to(by_node(u, back), SCALE, back)
    return back, turned


class DoesNotFit(BadInput):
    """A series that the store's type cannot hold: another job is needed, not another try."""


def _misfit(u: Array, stored: NDArray[Any]) -> str | None:
    """Return why a store's type cannot hold a signal, of which `stored` is what it holds."""
    lost = stored == MISSING if stored.dtype == np.int16 else ~np.isfinite(stored)
    if not lost.any():
        return None
    most = float(np.abs(u).max())
    if not np.isfinite(most):
        return "the observed signal u is not finite"
    limit = -(MISSING + 1) * SCALE if stored.dtype == np.int16 else np.finfo(np.float32).max
    other = 'set keep.dtype = "float32", with a new --out' if stored.dtype == np.int16 else ""
    text = f"u reaches {most:.5g}, and {stored.dtype} holds it up to {limit:.5g} only"
    return f"{text}: {other or 'observe a smaller signal'}"


class _Block:
    """Models, initial states and the result that the runs fill."""

    def __init__(
        self,
        sweep: Sweep,
        points: Points,
        on_signals: OnSignals | None,
        nudge: float = 0.0,
        starts: Array | None = None,
    ) -> None:
        n, times = len(points), sample_times(sweep)
        self.sweep, self.times, self.on_signals = sweep, times, on_signals
        rows = self.rows = [points.row(i) for i in range(n)]
        self.axes = points.axes
        self.models, self.initial = [], []
        self.settle = 0.0 if sweep.continue_ is None else sweep.continue_.settle
        for i, row in enumerate(rows):
            own = starts is None or bool(np.isnan(starts[i]).all())
            with foreign_code():
                model = build(sweep, row)
                self.models.append(model)
                start = None if own or starts is None else starts[i]
                self.initial.append(initial_state(sweep, row, model, nudge, start))
        self.options = sweep.features.options()
        self.panel = measures(sweep.measures.panel)
        self.keeps = series_mask(sweep, points.columns["seed"])
        width = max(model.n_nodes + model.n_second for model in self.models)
        self.result = empty_result(sweep, n, width if starts is None else starts.shape[1])
        # u of the run being measured, as it is stored, where the result has no room for it.
        self.stored: NDArray[Any] | None = None

    def integrate(
        self,
        rows: list[int],
        factor: float,
        may_retry: bool,
        should_stop: Callable[[], bool] | None,
        on_point: Callable[[int, Status], None] | None,
        lanes: int | None,
    ) -> list[int]:
        """Run the points ``rows``; return those to be tried again, which count as not reached."""
        if not rows:
            return []
        spec = self.sweep.integrator
        control = Control(
            t_end=self.settle + spec.t_end,
            start=self.settle + float(self.times[0]),
            step=spec.t_step,
            rtol=spec.rtol * factor,
            atol=spec.atol * factor,
            method=method(spec.method),
            max_steps=spec.max_steps,
            time_out=spec.time_out,
        )
        models = [self.models[row] for row in rows]
        again: list[int] = []

        def on_end(number: int, outcome: Outcome) -> None:
            row = rows[number]
            self.result.steps[row] += outcome.steps
            self.result.elapsed_us[row] += int(1e6 * outcome.elapsed)
            if may_retry and outcome.status in _RETRIED:
                again.append(row)
                return
            self.measure(row, outcome)
            if on_point is not None:
                on_point(row, Status(self.result.status[row]))

        def state(number: int) -> Array:
            return models[number].state(*self.initial[rows[number]])

        n_rows = max(model.n_rows for model in models)
        integrate(models, state, control, n_rows, on_end, should_stop, lanes)
        return again

    def measure(self, row: int, outcome: Outcome) -> None:
        result, model = self.result, self.models[row]
        result.status[row] = outcome.status
        is_done = outcome.status is Status.DONE
        if not is_done and self.on_signals is None:
            return
        outcome.samples[:, outcome.n_sampled :] = np.nan
        with foreign_code():
            u, w = model.node_pair(outcome.samples)
        is_kept = is_done and result.series is not None and self.keeps[row]
        kept = result.series[row] if is_kept and result.series is not None else None
        stored = self.room_for(model.n_nodes, kept)
        fits = store_as(u, stored)
        if self.on_signals is not None:
            self.on_signals(row, stored, w)
        if not is_done:
            return
        if kept is not None:
            if reason := _misfit(u, stored):
                raise DoesNotFit(f"{self.place(row)}: {reason}")
            if stored is not kept:
                kept[:, : model.n_nodes] = stored
        u, w = as_measured(u, w, stored, fits)
        if result.state is not None:
            last = _carried(model, *self.last(row, outcome.y_end))
            result.state[row, : len(last)] = last
        features = self.features(u)
        result.status[row] = features.status
        result.n_windows[row] = features.n_windows
        result.features[row, :, : model.n_nodes] = features.as_array()
        result.quality[row] = quality(features, self.sweep.integrator.t_step)
        result.scalars[row] = self.scalars(row, features, u.T, w.T, outcome.y_end)

    def room_for(self, size: int, kept: NDArray[Any] | None) -> NDArray[Any]:
        """Return an array (T, size) for u as it is stored: that of the result if it fits."""
        if kept is not None and size == kept.shape[1]:
            return kept
        if self.stored is None or size != self.stored.shape[1]:
            self.stored = np.empty((len(self.times), size), dtype=self.sweep.keep.dtype)
        return self.stored

    def place(self, row: int) -> str:
        """Return the point in words: ``P=3 seed=7``."""
        return " ".join(f"{name}={self.rows[row][name]}" for name in self.axes)

    def features(self, u: Array) -> NodeFeatures:
        return measure_signals(self.times, u.T, **self.options)

    def scalars(self, row: int, features: NodeFeatures, u: Array, w: Array, y_end: Array) -> Array:
        distance = self.distance(row, y_end)
        pairs = pairs_of(self.sweep, self.rows[row])
        run = MeasuredRun(self.times, u, w, features, self.sweep.features, distance, pairs)
        return _measure(self.panel, run)

    def last(self, row: int, y_end: Array) -> tuple[Array, Array]:
        """Return the last state (u, v) of a run."""
        model, t_end = self.models[row], self.settle + self.sweep.integrator.t_end
        v0, times = self.initial[row][1], np.array([t_end])
        return y_end[: model.n_nodes], model.second_variable(y_end[:, None], v0, times)[0]

    def distance(self, row: int, y_end: Array) -> float:
        """Distance of the last state (u, v) from the centre of the ball of initial states.

        In the norm of the ball (paper fig. 2).
        """
        model, spec = self.models[row], self.sweep.integrator
        u, v = model.equilibrium(spec.centre)
        first, second = self.last(row, y_end)
        offset = np.concatenate([first - u, second - v])
        if spec.ball == "maximum":
            return float(np.abs(offset).max())
        return float(np.sqrt(np.sum(offset * offset)))


def _carried(model: Model, u: Array, v: Array) -> Array:
    """Return a last state as one array, u then v, to start another run from.

    Phases are wrapped to [-pi, pi]: they would grow along a chain, and the error that the relative
    tolerance allows with them.
    """
    if isinstance(model, PhaseModel):
        u = np.angle(np.exp(1j * u))
    return np.concatenate([u, v])


def _measure(panel: list[Measure], run: MeasuredRun) -> Array:
    return np.array([number for measure in panel for number in measure.compute(run)])


def warm_up(sweep: Sweep, points: Points) -> None:
    """Compile every kernel that the sweep's points need, or read it from the disk.

    Called once before workers start, so that they find everything compiled.
    """
    tableau = method(sweep.integrator.method)
    model = build(sweep, points.row(0))
    warm_up_features(sweep, model)
    state = model.state(*initial_state(sweep, points.row(0), model))
    control = Control(t_end=0.02, start=0.0, step=0.01, method=tableau)
    for lanes in (1, LANES):
        integrate([model], [state], control, model.n_rows, lambda *_: None, lanes=lanes)


def warm_up_features(sweep: Sweep, model: Model) -> None:
    """Compile the right-hand side and every kernel but the stepping loops, or read them."""
    # Compiled, or read from the disk, when it is first asked for.
    _ = model.right_hand_side
    t = 0.01 * np.arange(2000.0)
    rows = np.sin(2.0 * np.pi * t + np.arange(3.0)[:, None])
    spec = sweep.features
    features = measure_signals(
        t, rows.T, window_reference=spec.window_reference, refine=spec.refine
    )
    one_group = spec.model_copy(update={"groups": 1})
    run = MeasuredRun(t, rows.T, rows.T, features, one_group, 0.0)
    _measure(measures(sweep.measures.panel), run)
    # In the integrator's order: time by time.
    samples = np.repeat(rows, 2, axis=0).T.copy().T
    stored = np.empty(rows.shape[::-1], dtype=np.int16)
    for fits in (False, True):
        store_as(samples[:3], stored)
        as_measured(samples[:3], samples[3:], stored, fits)
