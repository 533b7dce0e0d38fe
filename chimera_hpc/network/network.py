"""Networks: nodes and oriented links, with weights and triangles; the paper's ring is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network import files, generators, hodge, interchange
from chimera_hpc.network.checks import Array, Integers
from chimera_hpc.network.complex import SimplicialComplex
from chimera_hpc.network.generators import Seed


class Network(SimplicialComplex):
    r"""Nodes 0..N0-1 and oriented links, with optional weights and oriented triangles.

    A link is stored as (tail, head); reorienting it swaps the two. The incidence matrix B_1 has +1
    at the head and -1 at the tail of each link (paper eq. (3)). A triangle (a, b, c) runs
    from a to b to c to a. A network does not change: every method returns a new one, and the arrays
    are read-only.

    Parameters
    ----------
    n_nodes : int
        N0.
    links : array_like of int, shape (N1, 2)
        (tail, head) of each link. Every pair of nodes has at most one link.
    weights : array_like, shape (N1,), optional
        Weights of the links; default 1. Boundary matrices and Laplacians need weights >= 0, see
        `boundary`.
    triangles : array_like of int, shape (N2, 3), optional
        Nodes of each triangle; all three sides must be links.
    directed : bool
        If true, a link acts on its head only. A directed network has an adjacency matrix, but no
        boundary matrices or Laplacians.
    groups : array_like of int, shape (N0,), optional
        Community of each node.
    node_order : array_like of int, shape (N0,), optional
        The nodes in the order in which pictures and chains have them.
    half_degree : int
        P of a ring that `ring` made, 0 for any other network. Rings use the fast linear algebra of
        circulant matrices.

    Raises
    ------
    BadInput
        One line that names the first link, weight, triangle or node at fault.
    """

    @classmethod
    def ring(cls, n_nodes: int = 50, half_degree: int = 12, orientation: int = 1) -> Self:
        """Ring of N0 nodes, each linked to its P neighbours on either side.

        Link i P + (k - 1) joins node i and node i + k (mod N0), k = 1..P, counted from 0.
        Orientation 1 points every link clockwise, from i to i + k (fig. 1, left); its
        divergence is zero. Orientation 2 points it from the smaller index to the larger
        (fig. 17).

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
        links = hodge.ring_links(n_nodes, half_degree)
        links = np.sort(links, axis=1) if orientation == 2 else links
        return cls._unchecked(n_nodes=n_nodes, links=links, half_degree=half_degree)

    def reorient_node(self, node: int = 0, count: int = 0) -> Self:
        """Reverse the links between ``node`` and its ``count`` nearest neighbours on either side.

        The paper's Q: for each k = 1..Q both the link from the node to node + k and the link from
        node - k to the node are reversed, 2 Q links in total (fig. 1, middle and right).

        Raises
        ------
        BadInput
            Unless the network is a ring, 0 <= count <= P and 0 <= node < N0.
        """
        self._need_ring("reorient_node")
        if not 0 <= count <= self.half_degree:
            raise BadInput(f"Q = {count}: allowed is 0 to P = {self.half_degree}")
        self._need_node(node)
        return self.reorient(self.links_at(node, count))

    def links_at(self, node: int = 0, reach: int | None = None) -> Integers:
        """Indices of a node's links, shape (degree,).

        On a ring, the links to the next nodes come first, nearest first, then those to the previous
        ones, and ``reach`` takes the nearest neighbours on either side only, shape (2 reach,).
        """
        if not self.half_degree:
            if reach is not None:
                self._need_ring("reach")
            self._need_node(node)
            return np.flatnonzero((self.links == node).any(axis=1))
        k = np.arange(1, (self.half_degree if reach is None else reach) + 1)
        ahead = node * self.half_degree + k - 1
        behind = (node - k) % self.n_nodes * self.half_degree + k - 1
        return np.concatenate([ahead, behind])

    @cached_property
    def link_signs(self) -> Array:
        """Orientation of each link of a ring, shape (N1,): +1 when it points from i to i + k."""
        self._need_ring("link_signs")
        tail = np.repeat(np.arange(self.n_nodes), self.half_degree)
        return np.where(self.links[:, 0] == tail, 1.0, -1.0)

    @property
    def laplacian_eigenvalues(self) -> Array:
        r"""Eigenvalues of L_0 = B_1 B_1^T, shape (N0,): rising, or a ring's by Fourier mode.

        Of a ring, :math:`\Lambda_m = 2 \sum_{k=1}^{P} (1 - \cos(2 \pi m k / N_0))`: L_0 is
        circulant. They do not depend on the orientation.
        """
        if self.half_degree:
            return _eigenvalues(self.n_nodes, self.half_degree)
        values: Array = np.linalg.eigvalsh(self.laplacian(0).toarray())
        return values

    def solve_laplacian(self, w: Array, k: int = 0) -> Array:
        """L_k^+ w for signals w (N_k, ...): the solution of least norm.

        The part of w in the kernel of L_k is left out; for k = 0 and a connected network this is
        the mean of w.
        """
        if k > 0 or not self.half_degree:
            return super().solve_laplacian(w, k)
        n_modes = self.n_nodes // 2 + 1
        inverse = np.zeros(n_modes)
        inverse[1:] = 1.0 / self.laplacian_eigenvalues[1:n_modes]
        spectrum = np.fft.rfft(w, axis=0) * inverse.reshape(-1, *[1] * (w.ndim - 1))
        return np.fft.irfft(spectrum, n=self.n_nodes, axis=0)

    # -- makers ----------------------------------------------------------------------------------

    @classmethod
    def lattice(cls, shape: int | Sequence[int], periodic: bool = True) -> Self:
        """Lattice of any dimension with links from each node to the next one along every axis.

        Nodes are numbered in row-major order. On a periodic lattice the last node of an axis is
        linked to the first one; the divergence is then zero, and all sides are at least 3.
        """
        return cls._unchecked(**generators.lattice(shape, periodic))

    @classmethod
    def small_world(cls, n: int, P: int, rewire: float, seed: Seed = 0) -> Self:
        """Ring of n nodes whose links have a new head with probability ``rewire``.

        The links are those of `ring` in orientation 1; a rewired link keeps its tail and its place
        (Watts and Strogatz, Nature 393, 440 (1998)). rewire = 0 gives the ring.
        """
        return cls._unchecked(**generators.small_world(n, P, rewire, seed))

    @classmethod
    def scale_free(cls, n: int, m: int, seed: Seed = 0) -> Self:
        """Graph of Barabasi and Albert: each new node is linked to m others, chosen by degree.

        Links of this and of the other random graphs point from the lower to the higher node.
        """
        return cls._unchecked(**generators.scale_free(n, m, seed))

    @classmethod
    def random(cls, n: int, mean_degree: float, seed: Seed = 0) -> Self:
        """Graph with n mean_degree / 2 links (rounded) drawn uniformly (Erdos and Renyi)."""
        return cls._unchecked(**generators.random(n, mean_degree, seed))

    @classmethod
    def modular(cls, sizes: Sequence[int], p_in: float, p_out: float, seed: Seed = 0) -> Self:
        """Groups of nodes: pairs are linked with p_in within a group, with p_out across."""
        return cls._unchecked(**generators.modular(sizes, p_in, p_out, seed))

    @classmethod
    def two_populations(cls, n: int, A: float) -> Self:
        """Two populations of n nodes, all linked: 0..n-1 and n..2n-1.

        Weights are (1 + A)/(2 n) within and (1 - A)/(2 n) across, so that coupling strength 1 is
        that of Abrams, Mirollo, Strogatz and Wiley, Phys. Rev. Lett. 101, 084103 (2008).
        """
        return cls._unchecked(**generators.two_populations(n, A))

    @classmethod
    def multiplex(cls, layers: Sequence[SimplicialComplex], coupling: float = 1.0) -> Self:
        """Layers with the same nodes; links of weight ``coupling`` join the copies of a node."""
        return cls(**generators.multiplex(layers, coupling))

    @classmethod
    def from_edges(
        cls,
        edges: ArrayLike,
        n_nodes: int | None = None,
        weights: ArrayLike | None = None,
        directed: bool = False,
    ) -> Self:
        """Network of rows (tail, head) or (tail, head, weight); n_nodes default to all named."""
        return cls(**interchange.from_edges(edges, n_nodes, weights, directed))

    @classmethod
    def from_networkx(
        cls, graph: Any, weight: str = "weight", group: str = "group", directed: bool | None = None
    ) -> Self:
        """Network of a networkx graph, with nodes numbered in the order of the graph.

        ``weight`` and ``group`` name the attributes of edges and of nodes. An undirected graph has
        no orientations: links point from the lower to the higher number, unless the edge attribute
        "orientation" is -1, as `to_networkx` writes it. A DiGraph is a directed network; with
        ``directed=False`` its directions are orientations.
        """
        return cls(**interchange.from_networkx(graph, weight, group, directed))

    def to_networkx(self) -> Any:
        """Return a networkx Graph (or DiGraph) that `from_networkx` reads without loss."""
        return interchange.to_networkx(self)

    @classmethod
    def from_matrices(
        cls, B1: Any = None, B2: Any = None, adjacency: Any = None, directed: bool | None = None
    ) -> Self:
        """Network of boundary matrices, as `boundary` gives them, or of an adjacency matrix.

        Entry (i, j) of the adjacency is the weight of the link from j to i. A matrix that is not
        symmetric makes a directed network. Matrices may be dense or of scipy.sparse.

        Raises
        ------
        BadInput
            B1 B2 is not 0 (the message names the triangle), entries that are no links, loops.
        """
        if (B1 is None) == (adjacency is None):
            raise BadInput("from_matrices needs B1 (and perhaps B2) or adjacency, one of the two")
        if B1 is None:
            return cls(**interchange.from_adjacency(adjacency, directed))
        return cls(**interchange.from_boundaries(B1, B2))

    @classmethod
    def from_xgi(cls, simplices: Any, orientations: Mapping[Any, int] | None = None) -> Self:
        """Network of an XGI SimplicialComplex, oriented as by XGI's ``boundary_matrix``."""
        return cls(**interchange.from_xgi(simplices, orientations))

    def to_xgi(self) -> tuple[Any, dict[int, int]]:
        """Return an XGI SimplicialComplex and its orientations; weights are left out."""
        return interchange.to_xgi(self)

    @classmethod
    def from_file(
        cls, path: str | Path, n_nodes: int | None = None, directed: bool | None = None
    ) -> Self:
        """Network of a file, by the ending of its name.

        .csv, .tsv, .txt, .edges, .edgelist: one link per line as tail, head and perhaps weight, or
        a square table, an adjacency matrix. .graphml, .gml, .json (node-link). .npy, .npz, .mtx,
        .mat: an adjacency matrix, or an incidence matrix, which is not square; several arrays in
        one file are called "adjacency", "B1" and "B2".

        Raises
        ------
        BadInput
            A file that is no network, or one of another size than ``n_nodes``.
        """
        parts = files.read_parts(path, directed)
        try:
            network = cls(**parts)
        except BadInput as error:
            raise BadInput(f"{path}: {error}") from None
        if n_nodes not in (None, network.n_nodes):
            raise BadInput(f"{path} has {network.n_nodes} nodes, but n_nodes = {n_nodes}")
        return network

    # -- groups ----------------------------------------------------------------------------------

    @cached_property
    def communities(self) -> Integers:
        """Community of each node, shape (N0,): the given groups, or those that Louvain finds."""
        return interchange.louvain(self) if self.groups is None else self.groups

    @cached_property
    def order(self) -> Integers:
        """Nodes in the order of pictures and chains, shape (N0,).

        The given order; otherwise a ring's nodes as they are, and those of other networks by
        community.
        """
        if self.node_order is not None:
            return self.node_order
        if self.half_degree:
            return np.arange(self.n_nodes)
        return np.argsort(self.communities, kind="stable")

    def _need_ring(self, what: str) -> None:
        if not self.half_degree:
            raise BadInput(f"{what} is for rings; of other networks use reorient and links_at")

    def _need_node(self, node: int) -> None:
        if not 0 <= node < self.n_nodes:
            raise BadInput(f"node = {node}: allowed is 0 to {self.n_nodes - 1}")


# Every point of a sweep has its own ring, but there are few different sizes.
@lru_cache(maxsize=64)
def _eigenvalues(n_nodes: int, half_degree: int) -> Array:
    m = np.arange(n_nodes)[:, None]
    k = np.arange(1, half_degree + 1)[None, :]
    values: Array = 2.0 * (1.0 - np.cos(2.0 * np.pi * m * k / n_nodes)).sum(axis=1)
    values.flags.writeable = False
    return values
