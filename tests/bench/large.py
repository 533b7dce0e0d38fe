"""Time of the topological model on scale-free networks of rising size: linear in the links?

    PYTHONPATH=. python tests/bench/large.py

prints seconds of processor per accepted step of eight trajectories, and per stored entry of L_0.
Then, for small worlds in each cache, the cost of a stored entry in a slope of eight lanes (what ten
more neighbours cost), over a bare loop that adds the same eight numbers node by node.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from chimera_hpc import Network, TopologicalFHN
from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.lanes import Control, Outcome, integrate
from chimera_hpc.integrate.scratch import aligned
from chimera_hpc.integrate.simd import LANES, broadcast, load, store

SIZES = (1_000, 10_000, 100_000)
LINKS_EACH = 4
REPEATS = 5
TURNS = 300
WORLDS = (64, 200, 2_000, 20_000)
"""Nodes: eight lanes of u take 4 kB to 1.3 MB."""
ROWS = 10**5
"""Rows, or entries, per turn."""


def measured() -> Iterator[tuple[Network, int, float]]:
    """Yield networks, steps of a trajectory, and the least seconds of `REPEATS` for all of them."""
    rng = np.random.default_rng(0)
    control = Control(0.1, 0.1, 0.1, 1e-6, 1e-9)
    for n in SIZES:
        network = Network.scale_free(n, LINKS_EACH, seed=1)
        model = TopologicalFHN(network, 0.05, 0.5, -0.01)
        states = [1e-3 * rng.uniform(-1.0, 1.0, 2 * n) for _ in range(LANES)]
        steps: list[int] = []
        seconds = []
        for _ in range(REPEATS):
            begin = time.process_time()
            integrate([model] * LANES, states, control, 1, partial(_note, steps))
            seconds.append(time.process_time() - begin)
        yield network, max(steps), min(seconds)


@jit()
def _bare(y, rows, times, out):
    """Add eight lanes of all rows, in four sums."""
    zero = broadcast(0.0)
    a, b, c, d = zero, zero, zero, zero
    for _ in range(times):
        for i in range(0, rows, 4):
            a, b = a + load(zero, y, i), b + load(zero, y, i + 1)
            c, d = c + load(zero, y, i + 2), d + load(zero, y, i + 3)
    store(out, 0, (a + b) + (c + d))


def _least(runs: Sequence[Callable[[], object]]) -> list[float]:
    """Return the least seconds of processor of `TURNS` calls of each by turns, after one of each.

    Another process on the machine only makes a turn longer, so that the least tells most.
    """
    least = [math.inf] * len(runs)
    for turn in range(1 + TURNS):
        for number, run in enumerate(runs):
            begin = time.process_time()
            run()
            if turn > 0:
                least[number] = min(least[number], time.process_time() - begin)
    return least


@jit()
def _often(rhs, y, slopes, params, ints, times):
    for _ in range(times):
        rhs(y, slopes, params, ints)


def entry_and_row(n: int) -> tuple[float, float]:
    """Return the seconds per stored entry of a slope, and per row of the bare loop."""
    y, slopes = aligned(2 * n, LANES), aligned(2 * n, LANES)
    y[:] = np.random.default_rng(0).random(y.shape)
    calls, entries = [], []
    for half in (5, 10):
        network = Network.small_world(n, half, 0.1, seed=1)
        model = TopologicalFHN(network, 0.05, 0.5, -0.01)
        params = np.repeat(model.lane_params[:, None], LANES, axis=1)
        entries.append(network.laplacian(0).nnz)
        times = max(1, ROWS // entries[-1])
        what = model.right_hand_side, y, slopes, params, model.int_params, times
        calls.append((partial(_often, *what), times))
    times = max(1, ROWS // n)
    calls.append((partial(_bare, y, n, times, slopes), times * n))
    seconds = _least([call for call, _ in calls])
    fewer, more, bare = (spent / times for spent, (_, times) in zip(seconds, calls, strict=True))
    return (more - fewer) / (entries[1] - entries[0]), bare


def _note(steps: list[int], _: int, end: Outcome) -> None:
    steps.append(end.steps)


def main() -> None:
    """Print a line for each size."""
    print("nodes    links    entries   ms per step  ns per entry, lane and step")
    for network, steps, seconds in measured():
        entries = network.laplacian(0).nnz
        each = seconds / steps
        print(
            f"{network.n_nodes:<8} {network.n_links:<8} {entries:<9} {1e3 * each:<12.4g} "
            f"{1e9 * each / (entries * LANES):.3g}"
        )
    print("nodes    ns per entry   ns per row, bare   ratio")
    for n in WORLDS:
        entry, row = entry_and_row(n)
        print(f"{n:<8} {1e9 * entry:<14.3g} {1e9 * row:<18.3g} {entry / row:.2f}")


if __name__ == "__main__":
    main()
