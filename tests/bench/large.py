"""Time of the topological model on scale-free networks of rising size: linear in the links?

    PYTHONPATH=. python tests/bench/large.py

prints seconds of processor per accepted step of eight trajectories, and per stored entry of L_0.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial

import numpy as np

from chimera_hpc import Network, TopologicalFHN
from chimera_hpc.integrate.lanes import Control, Outcome, integrate
from chimera_hpc.integrate.simd import LANES

SIZES = (1_000, 10_000, 100_000)
LINKS_EACH = 4
REPEATS = 5


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


if __name__ == "__main__":
    main()
