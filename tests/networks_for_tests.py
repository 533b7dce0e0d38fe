"""Random networks that several test files use, and right-hand sides called by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.integrate.simd import LANES
from chimera_hpc.network.network import Network

SIGNALS = ("nodes", "links", "triangles")


def random_complex(seed: int, n: int = 12, chance: float = 0.45, weighted: bool = True) -> Network:
    """All cliques of a random graph, whose links have random orientations and weights."""
    rng = np.random.default_rng(seed)
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if rng.random() < chance]
    links = np.array([pair if rng.random() < 0.5 else pair[::-1] for pair in pairs])
    weights = rng.uniform(0.5, 2.0, len(links)) if weighted else None
    network = Network(n, links, weights=weights).with_triangles("cliques")
    assert network.n_triangles > 0
    return network


def complete(n: int) -> Network:
    """All links between n nodes."""
    return Network(n, np.array([(i, j) for i in range(n) for j in range(i + 1, n)]))


def two_populations(n: int, disparity: float) -> Network:
    """2 n nodes, all linked: weights (1 + A) / 2 n within a population, (1 - A) / 2 n across."""
    network = complete(2 * n)
    within = (network.links[:, 0] < n) == (network.links[:, 1] < n)
    return network.with_weights((1 + np.where(within, disparity, -disparity)) / (2 * n))


def slope(model: Any, state: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the right-hand side of one trajectory (n_rows,)."""
    return slopes([model], state[:, None])[:, 0]


def slopes(models: list[Any], states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the right-hand sides (n_rows, lanes) of one model or of `LANES` in one call."""
    assert len(models) in (1, LANES)
    y = np.ascontiguousarray(states)
    dy = np.full_like(y, np.nan)
    params = np.stack([model.lane_params for model in models], axis=1)
    models[0].right_hand_side(y, dy, params, models[0].int_params)
    return dy
