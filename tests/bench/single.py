"""One process, one core: ours against the peers, and the stepping loop against the machine."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import peers
from measure import interleaved, medians, multiplication_rate, second_cache, typical
from numpy.typing import NDArray
from problems import Ring, error
from scipy.integrate import solve_ivp

from chimera_hpc import simulate
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control, Outcome, choose_lanes, integrate
from chimera_hpc.job import registry
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.models.topological_fhn import TopologicalFHN

Array = NDArray[np.float64]

RTOL = 1e-6
LOOSER = tuple(float(f"{RTOL * 10.0 ** (k / 40):.3g}") for k in range(121))
"""Tolerances that are tried for an error that is not larger than a peer's, 6 % apart."""
HORIZON = 20.0
"""Errors are looked at up to here: later, chaos has made everything of them."""
SEEDS = 16
FLOPS_PER_NODE = 180
"""Floating-point operations of a step, counted for each node in the reduced form."""


@dataclass(frozen=True)
class Row:
    """One line of the table; without a target the value is only shown."""

    what: str
    value: float
    unit: str
    target: float | None
    at_least: bool = True
    note: str = ""

    def words(self) -> list[str]:
        value = f"{self.value:.3g} {self.unit}".strip()
        if self.target is None:
            return [self.what, value, "", "", self.note]
        good = self.value >= self.target if self.at_least else self.value <= self.target
        limit = f"{'≥' if self.at_least else '≤'} {self.target:.3g} {self.unit}".strip()
        return [self.what, value, limit, "yes" if good else "**no**", self.note]


@dataclass
class Scaling:
    """Seconds against what there is more of."""

    nodes: list[tuple[int, float]] = field(default_factory=list)
    """Nodes, and seconds a lane-step and node."""
    degrees: list[tuple[int, float]] = field(default_factory=list)
    """P, and seconds a lane-step of 50 nodes."""
    workers: list[tuple[int, float]] = field(default_factory=list)
    """Workers, and seconds of the whole plane."""
    points: list[tuple[int, float]] = field(default_factory=list)
    """Points, and seconds of a whole sweep with two workers."""


@dataclass(frozen=True)
class Sizes:
    """How much is measured; the small sizes are for the tests."""

    half_degrees: Sequence[int] = (12, 24)
    t_end: float = 200.0
    horizon: float = HORIZON
    repeats: int = 5
    at_least: float = 1.0
    """Seconds that each contender is given in its turn."""
    turns: int = 25
    """Repeats of what takes tenths of a second, so that half a minute is looked at."""
    nodes: Sequence[int] = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 30_000, 100_000)
    steps: int = 4000
    with_jax: bool = True


def one(ring: Ring, seed: int, rtol: float) -> Array:
    """Our `simulate`, u as it was sampled."""
    u, v = ring.initial(seed)
    run = simulate(
        ring.topology, u0=u, v0=v, t_end=ring.t_end, t_step=ring.t_step, rtol=rtol, atol=1e-3 * rtol
    )
    return run.u


def many(ring: Ring, seeds: int, rtol: float) -> None:
    """Our trajectories of all seeds, eight side by side, u sampled."""
    model = TopologicalFHN(ring.topology)
    states = [model.state(*ring.initial(seed)) for seed in range(seeds)]
    control = Control(ring.t_end, 0.0, ring.t_step, rtol, 1e-3 * rtol)
    ends: list[int] = []

    def on_end(number: int, outcome: Outcome) -> None:
        ends.append(outcome.n_sampled)

    integrate([model] * seeds, states, control, ring.n_nodes, on_end)
    assert len(ends) == seeds


def loosest(ring: Ring, limit: float, reference: Array) -> float:
    """Return our loosest tolerance whose error is not above `limit`."""
    short = Ring(ring.half_degree, ring.n_nodes, ring.t_step * (len(reference) - 1), ring.t_step)
    chosen = LOOSER[0]
    for rtol in LOOSER:
        if error(one(short, 0, rtol), reference) > limit:
            return chosen
        chosen = rtol
    return chosen


def against_peers(sizes: Sizes) -> list[Row]:
    """Latency of one trajectory and throughput of many, against SciPy and diffrax."""
    return [
        row
        for half_degree in sizes.half_degrees
        for row in _on_ring(Ring(half_degree, t_end=sizes.t_end), sizes)
    ]


def _on_ring(ring: Ring, sizes: Sizes) -> list[Row]:
    reference = ring.reference(0, sizes.horizon)
    rivals: dict[str, Callable[[], Array]] = {
        "SciPy RK45, full form": lambda: peers.scipy_full(ring, 0, RTOL),
        "SciPy RK45, reduced form": lambda: peers.scipy_reduced(ring, 0, RTOL),
    }
    batches: dict[str, Callable[[], Array]] = {}
    if sizes.with_jax:
        for form in ("full", "reduced"):
            solver, name = peers.diffrax(ring, form, RTOL), f"diffrax Tsit5, {form} form"
            rivals[name] = _first(solver, peers.states(ring, form, range(1)))
            batches[name] = _all(solver, peers.states(ring, form, range(SEEDS)))
    errors = {name: error(run(), reference) for name, run in rivals.items()}
    errors["ours"] = error(one(ring, 0, RTOL), reference)
    limits = {name: loosest(ring, found, reference) for name, found in errors.items()}
    runs: dict[str, Callable[[], object]] = dict(rivals)
    runs |= {f"{name}, together": run for name, run in batches.items()}
    for rtol in {RTOL, *limits.values()}:
        runs[f"ours at {rtol:g}"] = partial(one, ring, 0, rtol)
        runs[f"lanes at {rtol:g}"] = partial(many, ring, SEEDS, rtol)
    times = medians(interleaved(runs, sizes.repeats, sizes.at_least))
    return _compare(ring.half_degree, times, errors, limits)


def _first(solver: Callable[[Array], Array], states: Array) -> Callable[[], Array]:
    return lambda: solver(states)[0]


def _all(solver: Callable[[Array], Array], states: Array) -> Callable[[], Array]:
    return lambda: solver(states)


_TARGETS = {
    "SciPy RK45, full form": (100.0, 150.0),
    "diffrax Tsit5, full form": (None, 25.0),
    "diffrax Tsit5, reduced form": (None, 6.0),
}


def _compare(
    half_degree: int, times: dict[str, float], errors: dict[str, float], limits: dict[str, float]
) -> list[Row]:
    rows = []
    for name, (latency, throughput) in _TARGETS.items():
        if name not in times:
            continue
        rtol, alone = limits[name], times[name]
        note = f"{alone:.3g} s and error {errors[name]:.1e}; ours {{:.3g}} s at rtol {rtol:g}"
        note += f"; at rtol {RTOL:g} (error {errors['ours']:.1e}) {{:.3g}} times"
        if latency is not None:
            equal = times[f"ours at {rtol:g}"]
            same = alone / times[f"ours at {RTOL:g}"]
            what = f"one trajectory, P = {half_degree}, against {name}"
            text = note.format(equal, same)
            rows.append(Row(what, alone / equal, "times", latency, True, text))
        together = times.get(f"{name}, together")
        best = min(alone, together / SEEDS) if together else alone
        equal = times[f"lanes at {rtol:g}"] / SEEDS
        same = best / (times[f"lanes at {RTOL:g}"] / SEEDS)
        what = f"{SEEDS} trajectories, P = {half_degree}, against {name}"
        text = note.replace(f"{alone:.3g} s", f"{best:.3g} s per trajectory", 1).format(equal, same)
        rows.append(Row(what, best / equal, "times", throughput, True, text))
    return rows


@dataclass(frozen=True)
class LaneStep:
    """What a step of one trajectory costs, and which share of the steps was accepted."""

    seconds: float
    accepted: float


def lane_steps(rings: Sequence[tuple[int, int, int]], repeats: int) -> list[LaneStep]:
    """Return what a step costs that is tried, for eight trajectories of each ring (N0, P, steps).

    The time of half of `steps` is taken off that of one and a half times as many: what is left is
    the cost of `steps`, without beginning and end.
    """
    accepted: dict[str, float] = {}

    def run(name: str, model: TopologicalFHN, states: list[Array], steps: int) -> None:
        control = Control(1e6, 1e6, 0.01, max_steps=steps)
        ends: list[Outcome] = []
        integrate([model] * 8, states, control, 1, lambda _, end: ends.append(end))
        assert all(end.status is Status.STEP_BUDGET for end in ends)
        accepted[name] = sum(end.steps for end in ends) / (8 * steps)

    names = [f"{n_nodes} {half_degree}" for n_nodes, half_degree, _ in rings]
    runs: dict[str, Callable[[], object]] = {}
    for name, (n_nodes, half_degree, steps) in zip(names, rings, strict=True):
        ring = Ring(half_degree, n_nodes)
        model = TopologicalFHN(ring.topology)
        states = [model.state(*ring.initial(seed)) for seed in range(8)]
        runs[f"{name} short"] = partial(run, f"{name} short", model, states, steps // 2)
        runs[name] = partial(run, name, model, states, steps + steps // 2)
    times = interleaved(runs, repeats)
    spent = [
        np.subtract(times[name], times[f"{name} short"]) / (8 * steps)
        for name, (_, _, steps) in zip(names, rings, strict=True)
    ]
    return [
        LaneStep(seconds, accepted[name])
        for name, seconds in zip(names, typical(np.array(spent)), strict=True)
    ]


def nodes_in_second_cache() -> int:
    """Return the nodes of a ring whose state, stages and errors fill the second cache."""
    return second_cache() // ((registry.method("tsit5").stages + 3) * 2 * 8)


def _in_second_caches(n_nodes: int) -> float:
    return n_nodes / nodes_in_second_cache()


def _by_cache(costs: Sequence[tuple[int, float]]) -> dict[str, list[tuple[int, float]]]:
    """Return the costs of rings by where their state is and how many go side by side."""
    parts: dict[str, list[tuple[int, float]]] = {}
    for n, cost in costs:
        lanes = choose_lanes(8, 2 * n, registry.method("tsit5").stages, 1, 1)
        if lanes > 1:
            where = f"{lanes} trajectories side by side"
        elif _in_second_caches(n) <= 1.0:
            where = "one after the other, in the second cache"
        else:
            where = "one after the other, beyond the second cache"
        parts.setdefault(where, []).append((n, cost))
    return parts


def stepping(sizes: Sizes, scaling: Scaling) -> list[Row]:
    """Cost of a step: against dgemm, for two coupling ranges, for ever larger rings."""
    dgemm = multiplication_rate()
    long = 5 * sizes.steps
    halves = (1, 3, 6, 12, 18, 24)
    found = lane_steps([(50, half, long) for half in halves], sizes.turns)
    costs = {half: step.seconds for half, step in zip(halves, found, strict=True)}
    # Rejected steps do no useful work.
    useful = found[halves.index(12)]
    share = FLOPS_PER_NODE * 50 * useful.accepted / useful.seconds / dgemm
    note = f"{1e6 * useful.seconds / useful.accepted:.3f} us per accepted step of a lane, "
    note += f"{useful.accepted:.1%} of those tried; dgemm {dgemm / 1e9:.1f} GFlop/s"
    rows = [Row("useful work of the stepping loop, of dgemm's rate", share, "", 0.25, True, note)]
    scaling.degrees = list(costs.items())
    note = ", ".join(f"P = {half}: {1e6 * cost:.3f} us" for half, cost in scaling.degrees)
    ratio = costs[24] / costs[3]
    rows.append(Row("a step at P = 24 over one at P = 3", ratio, "", 1.1, False, note))
    rings = [(n, 12, max(sizes.steps * 50 // n, 20)) for n in sizes.nodes]
    steps = [step.seconds for step in lane_steps(rings, sizes.turns)]
    scaling.nodes = [(n, cost / n) for n, cost in zip(sizes.nodes, steps, strict=True)]
    note = ", ".join(f"{n}: {1e9 * cost:.2f} ns" for n, cost in scaling.nodes)
    # Caches make steps, which are shown: within each of them the cost should follow a line.
    for where, part in _by_cache(scaling.nodes).items():
        dearest, cheapest = (choose(cost for _, cost in part) for choose in (max, min))
        what = f"cost of a step, {part[0][0]} to {part[-1][0]} nodes: farthest from linear"
        if where.endswith("beyond the second cache"):
            size = [_in_second_caches(n) for n, _ in (part[0], part[-1])]
            where += f", {size[0]:.1f} to {size[1]:.1f} times as large as that"
        where += f"; a node at its dearest over its cheapest {dearest / cheapest:.2f}"
        # Relative distance from the line through the origin that is nearest to all of them.
        farthest = (dearest - cheapest) / (dearest + cheapest)
        rows.append(Row(what, farthest, "", 0.15, False, where))
    what = (
        f"cost of a node and step, dearest of {len(scaling.nodes)} rings over cheapest, all caches"
    )
    each = [cost for _, cost in scaling.nodes]
    rows.append(Row(what, max(each) / min(each), "", None, False, note))
    return rows


def features(sizes: Sizes) -> list[Row]:
    """What is measured of a trajectory, against its integration in lanes."""
    from chimera_hpc.job import Sweep

    text = 'name = "x"\nmodel = "topological_fhn"\n[grid]\nP = 12\nQ = "P"\nseeds = 16\n'
    text += f"[integrator]\nt_end = {1000.0 if sizes.steps > 1000 else 60.0}\n"
    text += f"[features]\nstart = {950.0 if sizes.steps > 1000 else 10.0}\n"
    sweep = Sweep.from_toml_text(text)
    points = sweep.points()
    runs = [_whole_and_measuring(sweep, points) for _ in range(sizes.turns + 1)][1:]
    share = statistics.median(measuring / (whole - measuring) for whole, measuring in runs)
    each = [1e3 * statistics.median(times) / len(points) for times in zip(*runs, strict=True)]
    note = f"{each[1]:.2f} ms of {each[0]:.2f} ms per trajectory"
    return [Row("features over integration, 50 nodes, P = 12", share, "", 0.25, False, note)]


def _whole_and_measuring(sweep: Any, points: Any) -> tuple[float, float]:
    """Return the seconds of a block, and those of them between the end of a run and its result."""
    from chimera_hpc.run import block as task

    block: Any = task._Block
    measure, spent = block.measure, []

    def timed(self: Any, row: int, outcome: Outcome) -> None:
        began = time.perf_counter()
        measure(self, row, outcome)
        spent.append(time.perf_counter() - began)

    block.measure = timed
    began = time.perf_counter()
    try:
        task.run_block(sweep, points)
    finally:
        block.measure = measure
    return time.perf_counter() - began, sum(spent)


def networked(sizes: Sizes) -> list[Row]:
    """The classical networked model: one trajectory and many, against SciPy."""
    n, half = 500, 165
    model = NetworkedFHN(n, half, 0.3)
    rng = np.random.default_rng(0)
    t_end = min(20.0, sizes.t_end / 10)
    times = 0.01 * np.arange(round(t_end / 0.01) + 1)
    states = [rng.uniform(-1, 1, 2 * n) for _ in range(SEEDS)]
    arguments = (n, half, model.sigma, model.epsilon, model.b, model.phi)

    def rival(rtol: float = RTOL, method: str = "RK45") -> Array:
        span, state = (0.0, times[-1]), states[0]
        options = {"rtol": rtol, "atol": 1e-3 * rtol}
        slope = peers.networked_slope
        done = solve_ivp(slope, span, state, method, times, args=arguments, **options)
        return np.asarray(done.y[:n].T)

    def ours(rtol: float = RTOL) -> Array:
        first = states[0]
        options = {"rtol": rtol, "atol": 1e-3 * rtol}
        return simulate(model, u0=first[:n], v0=first[n:], t_end=t_end, t_step=0.01, **options).u

    def lanes(rtol: float = RTOL) -> None:
        control = Control(t_end, 0.0, 0.01, rtol, 1e-3 * rtol)
        integrate([model] * SEEDS, states, control, n, lambda *_: None, lanes=8)

    reference = rival(1e-12, "DOP853")[times <= 5.0]
    limit, rtol = error(rival(), reference), LOOSER[0]
    for looser in LOOSER:
        if error(ours(looser), reference) > limit:
            break
        rtol = looser
    runs: dict[str, Callable[[], object]] = {
        "SciPy": rival, "one": lambda: ours(rtol), "lanes": lambda: lanes(rtol), "same": ours
    }  # fmt: skip
    found = medians(interleaved(runs, sizes.repeats, sizes.at_least))
    seconds, each = found["SciPy"], found["lanes"] / SEEDS
    note = f"SciPy {seconds:.3g} s and error {limit:.1e}, ours {each:.3g} s at rtol {rtol:g}; one "
    note += f"alone {seconds / found['one']:.3g} times, at rtol {RTOL:g} "
    note += f"{seconds / found['same']:.3g} times"
    return [
        Row("networked model, N0 = 500, P = 165, 16 trajectories, against SciPy RK45",
            seconds / each, "times", 20.0, True, note)
    ]  # fmt: skip
