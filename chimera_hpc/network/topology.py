"""Oriented rings: links, incidence matrix, divergence and the linear algebra of the ring."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Topology:
    r"""A ring of N0 nodes, each linked to its P neighbours on either side, with oriented links.

    Link i P + (k - 1) joins node i and node i + k (mod N0), k = 1..P, counted from 0. Its two ends
    are stored as (tail, head); reorienting a link swaps them in place. The incidence matrix has +1
    at the head and -1 at the tail of each link (paper eq. eq:B1initial).

    Parameters
    ----------
    n_nodes, half_degree : int
        N0 and P, with 2 P < N0.
    links : shape (N1, 2)
        (tail, head) of each link, in the order above.
    """

    n_nodes: int
    half_degree: int
    links: NDArray[np.int64]

    @classmethod
    def ring(cls, n_nodes: int = 50, half_degree: int = 12, orientation: int = 1) -> Topology:
        """Ring in one of the paper's two orientations.

        Orientation 1 points every link clockwise, from i to i + k (fig:orient, left); its
        divergence is zero. Orientation 2 points it from the smaller index to the larger
        (fig:orient:3).

        Raises
        ------
        BadInput
            Unless 1 <= P, 2 P < N0 and the orientation is 1 or 2.
        """
        if half_degree < 1 or 2 * half_degree >= n_nodes:
            raise BadInput(
                f"P = {half_degree} on a ring of {n_nodes} nodes: "
                "1 <= P and 2 P < n_nodes are needed"
            )
        if orientation not in (1, 2):
            raise BadInput(f"orientation = {orientation}: allowed are 1 and 2")
        tail = np.repeat(np.arange(n_nodes), half_degree)
        head = (tail + np.tile(np.arange(1, half_degree + 1), n_nodes)) % n_nodes
        links = np.column_stack([tail, head])
        return cls(n_nodes, half_degree, np.sort(links, axis=1) if orientation == 2 else links)

    @property
    def n_links(self) -> int:
        """Number of links N1 = N0 P."""
        return self.n_nodes * self.half_degree

    def reorient(self, links: NDArray[np.int64]) -> Topology:
        """Reverse the links with the given indices."""
        turned = self.links.copy()
        turned[links] = turned[links, ::-1]
        return Topology(self.n_nodes, self.half_degree, turned)

    def reorient_node(self, node: int = 0, count: int = 0) -> Topology:
        """Reverse the links between ``node`` and its ``count`` nearest neighbours on either side.

        The paper's Q: for each k = 1..Q both the link from the node to node + k and the link from
        node - k to the node are reversed, 2 Q links in total (fig:orient, middle and right).

        Raises
        ------
        BadInput
            Unless 0 <= count <= P and 0 <= node < N0.
        """
        if not 0 <= count <= self.half_degree:
            raise BadInput(f"Q = {count}: allowed is 0 to P = {self.half_degree}")
        if not 0 <= node < self.n_nodes:
            raise BadInput(f"node = {node}: allowed is 0 to {self.n_nodes - 1}")
        return self.reorient(self.links_at(node, count))

    def links_at(self, node: int = 0, reach: int | None = None) -> NDArray[np.int64]:
        """Indices (2 reach,) of a node's links to its ``reach`` nearest neighbours on either side.

        The links to the next nodes come first, then those to the previous ones. Default: all 2 P.
        """
        k = np.arange(1, (self.half_degree if reach is None else reach) + 1)
        ahead = node * self.half_degree + k - 1
        behind = (node - k) % self.n_nodes * self.half_degree + k - 1
        return np.concatenate([ahead, behind])

    def reorient_random(
        self,
        count: int,
        seed: int | np.random.Generator = 0,
        among: NDArray[np.int64] | None = None,
    ) -> Topology:
        """Reverse ``count`` different links drawn uniformly (the paper's Q_r, sec:orient2).

        They are drawn from all links, or from the links with indices ``among``.

        Raises
        ------
        BadInput
            Unless 0 <= count <= N1, or <= the number of ``among`` if given.
        """
        n_links = self.n_links if among is None else len(among)
        if not 0 <= count <= n_links:
            where = "of the ring" if among is None else "to draw from"
            raise BadInput(f"flips = {count}: allowed is 0 to the {n_links} links {where}")
        drawn = np.random.default_rng(seed).choice(n_links, count, replace=False)
        return self.reorient(drawn if among is None else among[drawn])

    @cached_property
    def link_signs(self) -> Array:
        """Orientation of each link, shape (N1,): +1 when it points from i to i + k, else -1."""
        tail = np.repeat(np.arange(self.n_nodes), self.half_degree)
        return np.where(self.links[:, 0] == tail, 1.0, -1.0)

    @cached_property
    def incidence(self) -> csr_array:
        """Incidence matrix B1, SciPy sparse, shape (N0, N1): +1 at heads, -1 at tails."""
        from scipy.sparse import csr_array

        index = np.arange(self.n_links)
        rows = np.concatenate([self.links[:, 1], self.links[:, 0]])
        values = np.repeat([1.0, -1.0], self.n_links)
        shape = (self.n_nodes, self.n_links)
        return csr_array((values, (rows, np.concatenate([index, index]))), shape=shape)

    @cached_property
    def divergence(self) -> Array:
        """Net divergence s = B1 1 of each node, shape (N0,): links in minus links out."""
        arriving = np.bincount(self.links[:, 1], minlength=self.n_nodes)
        leaving = np.bincount(self.links[:, 0], minlength=self.n_nodes)
        return (arriving - leaving).astype(np.float64)

    @property
    def laplacian_eigenvalues(self) -> Array:
        r"""Eigenvalues of L0 = B1 B1^T, shape (N0,), read-only, in the order of the Fourier modes.

        :math:`\Lambda_m = 2 \sum_{k=1}^{P} (1 - \cos(2 \pi m k / N_0))`: L0 is circulant and does
        not depend on the orientation.
        """
        return _eigenvalues(self.n_nodes, self.half_degree)

    def gather_links(self, v: Array) -> Array:
        """B1 v, the divergence of link signals v (N1, ...) at the nodes; returns (N0, ...)."""
        gathered: Array = self.incidence @ v
        return gathered

    def spread_to_links(self, u: Array) -> Array:
        """B1^T u: differences head - tail of node signals u (N0, ...); returns (N1, ...)."""
        return u[self.links[:, 1]] - u[self.links[:, 0]]

    def solve_laplacian(self, w: Array) -> Array:
        """L0^+ w for node signals w (N0, ...): the solution of zero mean of L0 x = w - mean(w)."""
        n_modes = self.n_nodes // 2 + 1
        inverse = np.zeros(n_modes)
        inverse[1:] = 1.0 / self.laplacian_eigenvalues[1:n_modes]
        spectrum = np.fft.rfft(w, axis=0) * inverse.reshape(-1, *[1] * (w.ndim - 1))
        return np.fft.irfft(spectrum, n=self.n_nodes, axis=0)

    def cycle_part(self, v: Array) -> Array:
        """Projection of link signals v (N1,) on the cycle space, the kernel of B1."""
        return v - self.spread_to_links(self.solve_laplacian(self.gather_links(v)))


# Every point of a sweep has its own ring, but there are few different sizes.
@lru_cache(maxsize=64)
def _eigenvalues(n_nodes: int, half_degree: int) -> Array:
    m = np.arange(n_nodes)[:, None]
    k = np.arange(1, half_degree + 1)[None, :]
    values: Array = 2.0 * (1.0 - np.cos(2.0 * np.pi * m * k / n_nodes)).sum(axis=1)
    values.flags.writeable = False
    return values
