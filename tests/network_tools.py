"""Random networks for tests, and their matrices written from the definitions."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network.network import Network

Array = NDArray[np.float64]


def random_complex(
    seed: int, n_nodes: int = 12, density: float = 0.5, weights: bool = True
) -> Network:
    """A clique complex of a random graph: links and triangles oriented and ordered at random."""
    rng = np.random.default_rng(seed)
    pairs = np.array(list(combinations(range(n_nodes), 2)), dtype=np.int64).reshape(-1, 2)
    links = rng.permutation(pairs[rng.random(len(pairs)) < density])
    links = np.where(rng.random(len(links))[:, None] < 0.5, links, links[:, ::-1])
    network = Network(n_nodes, links, rng.uniform(0.5, 2.0, len(links)) if weights else None)
    found = network.with_triangles("cliques").triangles
    kept = rng.permutation(found)[: int(0.7 * len(found))]
    return network.with_triangles(np.array([rng.permutation(row) for row in kept]).reshape(-1, 3))


@st.composite
def complexes(draw: st.DrawFn, weights: bool | None = None) -> Network:
    """A random complex of 1 to 12 nodes, also without links or triangles."""
    weighted = draw(st.booleans()) if weights is None else weights
    size, density = draw(st.integers(1, 12)), draw(st.sampled_from([0.0, 0.3, 0.6, 1.0]))
    return random_complex(draw(st.integers(0, 10**6)), size, density, weighted)


def boundaries(network: Network) -> tuple[Array, Array]:
    """Dense B_1 and B_2 without weights, entry by entry."""
    b_1 = np.zeros((network.n_nodes, network.n_links))
    place = {}
    for index, (tail, head) in enumerate(network.links.tolist()):
        b_1[head, index], b_1[tail, index] = 1.0, -1.0
        place[tail, head], place[head, tail] = (index, 1.0), (index, -1.0)
    b_2 = np.zeros((network.n_links, network.n_triangles))
    for index in range(network.n_triangles):
        assert network.triangles is not None
        a, b, c = network.triangles[index].tolist()
        for side in ((a, b), (b, c), (c, a)):
            link, sign = place[side]
            b_2[link, index] = sign
    return b_1, b_2


def dense_dirac(network: Network, k: int) -> Array:
    """Dense D = [B_k^T, B_{k+1}] of the symmetric weighting, from its definition."""
    b_1, b_2 = boundaries(network)
    root = np.ones(network.n_links) if network.weights is None else np.sqrt(network.weights)
    b_1, b_2 = b_1 * root, b_2 / root[:, None]
    return [b_1, np.hstack([b_1.T, b_2]), b_2.T][k]


def refusal(make: Callable[[], object]) -> str:
    """Return the one line with which bad input is refused."""
    with pytest.raises(BadInput) as caught:
        make()
    assert "\n" not in str(caught.value)
    return str(caught.value)
