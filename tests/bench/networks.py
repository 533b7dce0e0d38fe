"""Networks, one process and one core: ours against SciPy, diffrax and XGI, at equal error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.util import find_spec
from typing import Any

import numpy as np
import peers
from measure import interleaved, medians
from numpy.typing import NDArray
from problems import EPSILON, B, C, error
from scipy.integrate import solve_ivp
from single import LOOSER, RTOL, SEEDS, Row, Sizes

from chimera_hpc import Network, SimplicialKuramoto, TopologicalFHN
from chimera_hpc.integrate.lanes import Control, Outcome, integrate

Array = NDArray[np.float64]
EULER_STEPS = 20_000
"""Steps of XGI's Euler method, over `T_PHASES`."""
T_PHASES = 10.0
HORIZON = 5.0
"""Errors are compared up to here: the small world is chaotic, at t = 15 all trajectories part."""


@dataclass(frozen=True)
class World:
    """A small world of topological oscillators, an initial state for each seed, and times."""

    n_nodes: int = 200
    half_degree: int = 5
    t_end: float = 200.0
    t_step: float = 0.1

    @cached_property
    def network(self) -> Network:
        return Network.small_world(self.n_nodes, self.half_degree, 0.1, seed=1)

    @cached_property
    def model(self) -> TopologicalFHN:
        return TopologicalFHN(self.network, EPSILON, B, C)

    @cached_property
    def times(self) -> Array:
        return self.t_step * np.arange(round(self.t_end / self.t_step) + 1)

    def initial(self, seed: int) -> tuple[Array, Array]:
        """Return u0 (N0,) and v0 (N1,)."""
        rng = np.random.default_rng([seed, self.n_nodes])
        return rng.uniform(-1, 1, self.n_nodes), rng.uniform(-1, 1, self.network.n_links)

    def reduced(self, seed: int) -> Array:
        """Return the initial u and w."""
        return self.model.state(*self.initial(seed))


def ours(world: World, seeds: int, rtol: float) -> Array:
    """Return u (T, N0) of the first seed of several that run in lanes."""
    control = Control(world.times[-1], 0.0, world.t_step, rtol, 1e-3 * rtol)
    first: list[Array] = []

    def on_end(number: int, outcome: Outcome) -> None:
        if number == 0:
            first.append(outcome.samples.T.copy())

    states = [world.reduced(seed) for seed in range(seeds)]
    integrate([world.model] * seeds, states, control, world.n_nodes, on_end)
    return first[0]


def scipy_full(world: World, rtol: float) -> Array:
    """Return u (T, N0) by RK45 and the compiled node-link form."""
    tail, head = world.network.links.T.copy()
    state, n = np.concatenate(world.initial(0)), world.n_nodes
    found = solve_ivp(
        peers.full_slope,
        (0.0, world.times[-1]),
        state,
        t_eval=world.times,
        args=(n, tail, head),
        rtol=rtol,
        atol=1e-3 * rtol,
    )
    return np.asarray(found.y[:n].T)


def reference(world: World, t_end: float) -> Array:
    """Return u (T, N0) by DOP853 at rtol 1e-13, in reduced form."""
    n, laplacian = world.n_nodes, world.network.laplacian(0)
    source = B * world.network.source(0)

    def slope(t: float, y: Array) -> Array:
        u, w = y[:n], y[n:]
        return np.concatenate([(u - u**3 / 3 - w) / EPSILON, source + C * w + laplacian @ u])

    times = world.times[world.times <= t_end + 1e-9]
    span = (0.0, times[-1])
    state = world.reduced(0)
    found = solve_ivp(slope, span, state, "DOP853", times, rtol=1e-13, atol=1e-14)
    return np.asarray(found.y[:n].T)


def diffrax(world: World, rtol: float) -> Callable[[], Array]:
    """Return a call of the compiled solver of all seeds, whose Laplacian is a BCOO matrix."""
    import diffrax as dfx
    import jax
    from jax.experimental import sparse

    jax.config.update("jax_enable_x64", True)
    jnp = jax.numpy
    n = world.n_nodes
    laplacian = sparse.BCOO.from_scipy_sparse(world.network.laplacian(0).tocoo())
    source = jnp.asarray(B * world.network.source(0))

    def slope(t: Any, y: Any, args: Any) -> Any:
        u, w = y[:n], y[n:]
        return jnp.concatenate([(u - u**3 / 3.0 - w) / EPSILON, source + C * w + laplacian @ u])

    def solve(state: Any) -> Any:
        save = dfx.SaveAt(ts=jnp.asarray(world.times), fn=lambda t, y, args: y[:n])
        control = dfx.PIDController(rtol=rtol, atol=1e-3 * rtol)
        term, end = dfx.ODETerm(slope), world.times[-1]
        return dfx.diffeqsolve(
            term,
            dfx.Tsit5(),
            0.0,
            end,
            None,
            state,
            saveat=save,
            stepsize_controller=control,
            max_steps=None,
        ).ys

    compiled = jax.jit(jax.vmap(solve))
    states = np.array([world.reduced(seed) for seed in range(SEEDS)])
    return lambda: np.asarray(compiled(states))[0]


def against_peers(sizes: Sizes) -> list[Row]:
    """Return the rows of the small world and, with XGI, of the simplicial Kuramoto model."""
    tiny = sizes.t_end < 10.0
    world = World(30, 2, sizes.t_end, 0.1) if tiny else World(t_end=sizes.t_end)
    exact = reference(world, min(HORIZON, sizes.horizon))
    rivals: dict[str, tuple[Callable[[], Array], int, float]] = {
        "SciPy RK45, node-link form": (partial(scipy_full, world, RTOL), 1, 60.0)
    }
    if sizes.with_jax:
        rivals["diffrax Tsit5 with BCOO, reduced form"] = (diffrax(world, RTOL), SEEDS, 10.0)
    found = {name: error(run(), exact) for name, (run, _, _) in rivals.items()}
    limits = {name: _loosest(partial(ours, world, SEEDS), e, exact) for name, e in found.items()}
    runs: dict[str, Callable[[], object]] = {name: run for name, (run, _, _) in rivals.items()}
    runs |= {f"ours at {r:g}": partial(ours, world, SEEDS, r) for r in limits.values()}
    times = medians(interleaved(runs, sizes.repeats, sizes.at_least))
    rows = []
    for name, (_, seeds, target) in rivals.items():
        peer, own = times[name] / seeds, times[f"ours at {limits[name]:g}"] / SEEDS
        note = f"{peer:.3g} s per trajectory and error {found[name]:.1e}; "
        note += f"ours {own:.3g} s at rtol {limits[name]:g}"
        what = f"{SEEDS} trajectories, small world of {world.n_nodes} nodes, against {name}"
        rows.append(Row(what, peer / own, "times", target, True, note))
    return rows + (_phases(sizes, tiny) if find_spec("xgi") else [])


def _loosest(run: Callable[[float], Array], limit: float, exact: Array) -> float:
    chosen = 0
    for stride in (4, 1):
        for rtol in LOOSER[chosen + stride :: stride]:
            if error(run(rtol), exact) > limit:
                break
            chosen += stride
    return LOOSER[chosen]


def _phases(sizes: Sizes, tiny: bool) -> list[Row]:
    import xgi

    n, steps = (12, 200) if tiny else (100, EULER_STEPS)
    complex_ = xgi.random_flag_complex_d2(n, 0.08 if n == 100 else 0.5, seed=2)
    network = Network.from_xgi(complex_)
    rng = np.random.default_rng(0)
    omega, start = rng.normal(size=network.n_links), rng.uniform(0, 6, network.n_links)
    dense_1, dense_2 = network.boundary(1).toarray(), network.boundary(2).toarray()
    model = SimplicialKuramoto(network, 1, 1.0, omega)

    def slope(t: float, x: Array) -> Array:
        down = dense_1.T @ np.sin(dense_1 @ x)
        return np.asarray(omega - down - dense_2 @ np.sin(dense_2.T @ x))

    span = (0.0, T_PHASES)
    exact = solve_ivp(slope, span, start, "DOP853", span, rtol=1e-12, atol=1e-12).y.T[1:]

    def euler() -> Array:
        # Its last sample is a step before the end that it is given.
        end = T_PHASES * steps / (steps - 1)
        found, _, _ = xgi.simulate_simplicial_kuramoto(
            complex_, None, 1, omega[:, None], 1.0, start[:, None], end, steps
        )
        return np.asarray(found)[:, -1:].T

    def own(rtol: float) -> Array:
        control = Control(T_PHASES, T_PHASES, T_PHASES, rtol, 1e-3 * rtol)
        ends: list[Array] = []
        integrate([model], [start], control, 1, lambda _, end: ends.append(end.y_end))
        return ends[0][None]

    limit = error(euler(), exact)
    rtol = _loosest(own, limit, exact)
    runs: dict[str, Callable[[], object]] = {"xgi": euler, "ours": partial(own, rtol)}
    times = medians(interleaved(runs, sizes.repeats, sizes.at_least))
    note = f"{network.n_links} links, {network.n_triangles} triangles; {times['xgi']:.3g} s and "
    note += f"error {limit:.1e} in {steps} Euler steps; ours {times['ours']:.3g} s at rtol {rtol:g}"
    what = f"simplicial Kuramoto, {n} nodes, against XGI"
    return [Row(what, times["xgi"] / times["ours"], "times", 100.0, True, note)]
