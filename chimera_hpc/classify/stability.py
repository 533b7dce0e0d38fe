r"""Linear stability of the homogeneous equilibria (paper, app. A).

About (u*, v*) with v* = -b/c, every singular value b_alpha of B1 has a block

    J_alpha = [[ (1 - u*^2) / epsilon , -b_alpha / epsilon ],
               [ b_alpha              , c                  ]] .

The eigenvalues of the whole Jacobian (N0 + N1) are those of the N0 - 1 blocks with b_alpha > 0,
then (1 - u*^2)/epsilon for the constant node mode, and c for the N1 - N0 + 1 modes on cycles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.spatial import cKDTree

from chimera_hpc.classify.tree import Floats
from chimera_hpc.network.topology import Topology

Complex = NDArray[np.complex128]


def block_eigenvalues(slope: float, epsilon: float, c: float, singular: Floats) -> Complex:
    """Eigenvalues of J_alpha for each singular value b_alpha (k,), shape (k, 2).

    ``slope`` is 1 - u*^2. They are the roots of l^2 - (s/e + c) l + (c s/e + b^2/e). To avoid
    cancellation, the root of larger modulus is computed first, the other from the product.
    """
    trace = slope / epsilon + c
    product = c * slope / epsilon + np.asarray(singular) ** 2 / epsilon
    root = np.sqrt(np.asarray(trace * trace - 4.0 * product, dtype=np.complex128))
    large = 0.5 * (trace + np.where(trace >= 0.0, root, -root))
    return np.stack([large, product / large], axis=-1)


def predicted_spectrum(topology: Topology, epsilon: float, c: float, equilibrium: float) -> Complex:
    """All eigenvalues of the Jacobian from the blocks, shape (N0 + N1,)."""
    slope = 1.0 - equilibrium**2
    singular = np.sqrt(np.maximum(topology.laplacian_eigenvalues[1:], 0.0))
    cycles = np.full(topology.n_links - topology.n_nodes + 1, c, dtype=np.complex128)
    blocks = block_eigenvalues(slope, epsilon, c, singular).ravel()
    return np.concatenate([blocks, [slope / epsilon], cycles])


def jacobian(topology: Topology, epsilon: float, c: float, equilibrium: float) -> Floats:
    """The whole Jacobian at a homogeneous equilibrium, shape (N0 + N1, N0 + N1)."""
    n, incidence = topology.n_nodes, topology.incidence.toarray()
    matrix = np.zeros((n + topology.n_links, n + topology.n_links))
    matrix[:n, :n] = np.eye(n) * ((1.0 - equilibrium**2) / epsilon)
    matrix[:n, n:] = -incidence / epsilon
    matrix[n:, :n] = incidence.T
    matrix[n:, n:] = np.eye(topology.n_links) * c
    return matrix


def spectrum_distance(first: Complex, second: Complex) -> float:
    """Largest distance of an eigenvalue of either spectrum from the nearest one of the other."""
    one, other = (np.stack([x.real, x.imag], axis=1) for x in (first, second))
    ways = (cKDTree(other).query(one)[0], cKDTree(one).query(other)[0])
    return float(max(np.max(way) for way in ways))


def full_spectrum(topology: Topology, epsilon: float, c: float, equilibrium: float) -> Complex:
    """Eigenvalues of the whole Jacobian, computed without the blocks.

    The links are rescaled by sqrt(epsilon): a similarity that balances the two off-diagonal parts.
    """
    matrix, n = jacobian(topology, epsilon, c, equilibrium), topology.n_nodes
    matrix[:n, n:] *= np.sqrt(epsilon)
    matrix[n:, :n] /= np.sqrt(epsilon)
    found: Complex = np.asarray(eigvals(matrix, check_finite=False), dtype=np.complex128)
    return found


def residual(topology: Topology, b: float, c: float, equilibrium: float) -> float:
    """Largest modulus of the right-hand side at (u*, -b/c): zero where it is an equilibrium."""
    links = np.full(topology.n_links, -b / c)
    nodes = equilibrium - equilibrium**3 / 3.0 - topology.gather_links(links)
    flow = b + c * links + topology.spread_to_links(np.full(topology.n_nodes, equilibrium))
    return float(max(np.abs(nodes).max(), np.abs(flow).max()))
