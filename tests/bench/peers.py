"""The other ways to integrate the same equations: SciPy and diffrax, as their manuals advise.

SciPy gets a compiled right-hand side. diffrax is compiled as a whole, in 64 bits; the full form
gathers and scatters along the links (a dense incidence matrix would cost N0 times as much).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from problems import EPSILON, B, C, Ring
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]


@numba.njit
def full_slope(t, y, n, tail, head):  # type: ignore[no-untyped-def]
    """Node-link equations as printed in the paper."""
    dy = np.empty_like(y)
    for i in range(n):
        dy[i] = y[i] - y[i] ** 3 / 3.0
    for j in range(tail.size):
        v = y[n + j]
        dy[head[j]] -= v
        dy[tail[j]] += v
        dy[n + j] = B + C * v + (y[head[j]] - y[tail[j]])
    for i in range(n):
        dy[i] /= EPSILON
    return dy


@numba.njit
def reduced_slope(t, y, n, half, source):  # type: ignore[no-untyped-def]
    """Node equations, with the sliding sum."""
    dy = np.empty_like(y)
    total = 0.0
    for k in range(-half, half + 1):
        total += y[k % n]
    for i in range(n):
        u, w = y[i], y[n + i]
        dy[i] = (u - u * u * u / 3.0 - w) / EPSILON
        dy[n + i] = source[i] + C * w + (2 * half + 1) * u - total
        total += y[(i + 1 + half) % n] - y[(i - half) % n]
    return dy


@numba.njit
def networked_slope(t, y, n, half, sigma, epsilon, b, phi):  # type: ignore[no-untyped-def]
    """The classical networked model, with sliding sums."""
    dy = np.empty_like(y)
    same, cross, gain = np.cos(phi), np.sin(phi), sigma / (2 * half)
    sum_x = sum_z = 0.0
    for k in range(-half, half + 1):
        sum_x += y[k % n]
        sum_z += y[n + k % n]
    for i in range(n):
        x, z = y[i], y[n + i]
        pull_x, pull_z = sum_x - (2 * half + 1) * x, sum_z - (2 * half + 1) * z
        dy[i] = (x - x**3 / 3.0 - z + gain * (same * pull_x + cross * pull_z)) / epsilon
        dy[n + i] = x + b + gain * (same * pull_z - cross * pull_x)
        sum_x += y[(i + 1 + half) % n] - y[(i - half) % n]
        sum_z += y[n + (i + 1 + half) % n] - y[n + (i - half) % n]
    return dy


def scipy_full(ring: Ring, seed: int, rtol: float, method: str = "RK45") -> Array:
    """Return u (T, N0)."""
    tail, head = ring.topology.links.T.copy()
    arguments = (ring.n_nodes, tail, head)
    return _scipy(full_slope, np.concatenate(ring.initial(seed)), arguments, ring, rtol, method)


def scipy_reduced(ring: Ring, seed: int, rtol: float, method: str = "RK45") -> Array:
    """Return u (T, N0)."""
    u, v = ring.initial(seed)
    state = np.concatenate([u, ring.topology.gather_links(v)])
    arguments = (ring.n_nodes, ring.half_degree, B * ring.topology.divergence)
    return _scipy(reduced_slope, state, arguments, ring, rtol, method)


def _scipy(
    slope: Any, state: Array, arguments: tuple[Any, ...], ring: Ring, rtol: float, method: str
) -> Array:
    done = solve_ivp(
        slope,
        (0.0, ring.times[-1]),
        state,
        method=method,
        t_eval=ring.times,
        args=arguments,
        rtol=rtol,
        atol=1e-3 * rtol,
    )
    return np.asarray(done.y[: ring.n_nodes].T)


@cache
def _jax() -> Any:
    import jax

    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    return jax


def diffrax(ring: Ring, form: str, rtol: float) -> Callable[[Array], Array]:
    """Return the compiled solver: initial states (seeds, rows) to u (seeds, T, N0)."""
    import diffrax as dfx

    jax = _jax()
    jnp = jax.numpy
    n, half = ring.n_nodes, ring.half_degree
    tail, head = (jnp.asarray(ends) for ends in ring.topology.links.T)
    source = jnp.asarray(B * ring.topology.divergence)

    def full(t: Any, y: Any, args: Any) -> Any:
        u, v = y[:n], y[n:]
        flow = jnp.zeros(n).at[head].add(v).at[tail].add(-v)
        return jnp.concatenate([(u - u**3 / 3.0 - flow) / EPSILON, B + C * v + u[head] - u[tail]])

    def reduced(t: Any, y: Any, args: Any) -> Any:
        u, w = y[:n], y[n:]
        sums = jnp.cumsum(jnp.concatenate([jnp.zeros(1), u[n - half :], u, u[:half]]))
        total = sums[2 * half + 1 :] - sums[:n]
        slope_w = source + C * w + (2 * half + 1) * u - total
        return jnp.concatenate([(u - u**3 / 3.0 - w) / EPSILON, slope_w])

    term = dfx.ODETerm(full if form == "full" else reduced)
    control = dfx.PIDController(rtol=rtol, atol=1e-3 * rtol)
    times = jnp.asarray(ring.times)

    def solve(state: Any) -> Any:
        done = dfx.diffeqsolve(
            term,
            dfx.Tsit5(),
            t0=0.0,
            t1=ring.times[-1],
            dt0=None,
            y0=state,
            saveat=dfx.SaveAt(ts=times, fn=lambda t, y, args: y[:n]),
            stepsize_controller=control,
            max_steps=None,
        )
        return done.ys

    compiled = jax.jit(jax.vmap(solve))
    single = jax.jit(solve)

    def run(states: Array) -> Array:
        if len(states) == 1:
            return np.asarray(single(states[0]))[None]
        return np.asarray(compiled(states))

    return run


def states(ring: Ring, form: str, seeds: range) -> Array:
    """Return the initial states (seeds, rows) of one of the two forms."""
    rows = []
    for seed in seeds:
        u, v = ring.initial(seed)
        rows.append(np.concatenate([u, v if form == "full" else ring.topology.gather_links(v)]))
    return np.array(rows)
