"""A network like a brain's: areas in two hemispheres, with links that get weaker with distance."""

import numpy as np

from chimera_hpc import Network


def brain(n_nodes: int, reach: float = 0.2, degree: float = 8.0, seed: int = 0) -> Network:
    """Areas at random places of two balls side by side, the strongest n degree / 2 links of all.

    The weight of a link falls as exp(-distance / reach), times a log-normal number. A chain through
    all areas keeps the network connected. The hemispheres are the communities.
    """
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(n_nodes, 3))
    places *= rng.uniform(size=(n_nodes, 1)) ** (1 / 3) / np.linalg.norm(places, axis=1)[:, None]
    side = np.sort(rng.integers(2, size=n_nodes))
    places[:, 0] += 2.1 * side
    tail, head = np.triu_indices(n_nodes, 1)
    distance = np.linalg.norm(places[tail] - places[head], axis=1)
    weight = np.exp(-distance / reach) * rng.lognormal(sigma=1.0, size=len(tail))
    chosen = np.zeros(len(tail), dtype=bool)
    chosen[np.argsort(-weight)[: round(n_nodes * degree / 2)]] = True
    chosen |= head == tail + 1
    edges = np.column_stack([tail, head])[chosen]
    relative = weight[chosen] / weight[chosen].max()
    network = Network.from_edges(edges, n_nodes, np.maximum(relative, 0.01))
    return network.with_groups(side)
