"""Nodes, oriented links and triangles, and the matrices that relate their signals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from hashlib import blake2b
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import generator
from chimera_hpc.network import checks, hodge
from chimera_hpc.network.checks import Array, Integers, check_indices

if TYPE_CHECKING:
    from scipy.sparse import csr_array

SIGNALS = ("nodes", "links", "triangles")
"""Where a signal lives, by the dimension k of the simplex."""

MOST_RANKED = 4000
"""Most links or triangles whose boundary matrix is ranked as a dense one."""


@dataclass(frozen=True, eq=False)
class SimplicialComplex:
    """Nodes, oriented links and oriented triangles, with read-only arrays.

    `Network` is this with its makers; make values with that.
    """

    n_nodes: int
    links: Integers
    weights: Array | None = None
    triangles: Integers | None = None
    directed: bool = False
    groups: Integers | None = None
    node_order: Integers | None = None
    half_degree: int = 0

    def __post_init__(self) -> None:
        """Check all parts and keep copies of them."""
        n = checks.node_count(self.n_nodes)
        links = checks.checked_links(n, self.links, self.directed)
        parts: dict[str, Any] = {"n_nodes": n, "links": links}
        optional: dict[str, Callable[[Any], Any]] = {
            "weights": lambda given: checks.checked_weights(given, len(links)),
            "triangles": lambda given: checks.checked_triangles(n, given, links),
            "groups": lambda given: checks.checked_labels("groups", given, n),
            "node_order": lambda given: checks.checked_order(given, n),
        }
        for name, check in optional.items():
            given = getattr(self, name)
            parts[name] = None if given is None else check(given)
        self._set(parts)

    @classmethod
    def _unchecked(cls, **parts: Any) -> Self:
        """Return an object from parts that are known to be consistent, without checks."""
        made = object.__new__(cls)
        made._set({field.name: field.default for field in fields(cls)} | parts)
        return made

    def _set(self, parts: dict[str, Any]) -> None:
        for name, part in parts.items():
            if isinstance(part, np.ndarray):
                part = checks.frozen(part, part.dtype)
            object.__setattr__(self, name, part)

    def _with(self, **parts: Any) -> Self:
        """Return a copy with other parts, which are known to fit."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        return self._unchecked(**own | parts)

    # -- sizes -----------------------------------------------------------------------------------

    @property
    def kind(self) -> str:
        """The word in messages: "ring" if `Network.ring` made it, otherwise "network"."""
        return "ring" if self.half_degree else "network"

    @property
    def n_links(self) -> int:
        """Number of links N1."""
        return len(self.links)

    @property
    def n_triangles(self) -> int:
        """Number of triangles N2."""
        return 0 if self.triangles is None else len(self.triangles)

    def size(self, signals: str = "nodes") -> int:
        """Return the number of "nodes", "links" or "triangles"."""
        return (self.n_nodes, self.n_links, self.n_triangles)[dimension(signals)]

    @cached_property
    def digest(self) -> str:
        """16 hexadecimal digits of nodes, links with their orientation, weights and triangles."""
        text = blake2b(f"{self.n_nodes} {self.directed}".encode(), digest_size=8)
        for part in (self.links, self.weights, self.triangles):
            array = np.empty(0) if part is None else part
            text.update(f"{array.shape}{array.dtype.kind}".encode())
            text.update(np.ascontiguousarray(array).tobytes())
        return text.hexdigest()

    # -- copies ----------------------------------------------------------------------------------

    def with_weights(self, weights: ArrayLike | None) -> Self:
        """Return the network with other weights, shape (N1,), or without.

        Raises
        ------
        BadInput
            Another number of weights than links, or weights that are not finite.
        """
        if weights is None:
            return self._with(weights=None)
        checked = checks.checked_weights(weights, self.n_links)
        # A ring's own sums know no weights.
        return self._with(weights=checked, half_degree=0)

    def with_triangles(self, triangles: str | ArrayLike | None = "cliques") -> Self:
        """Return the network with triangles: all "cliques" of three links, "none", or given ones.

        Given triangles have shape (N2, 3); (a, b, c) is oriented from a to b to c to a. Cliques run
        through their nodes in rising order.

        Raises
        ------
        BadInput
            A triangle with a side that is no link, or one that is given twice; a directed network.
        """
        self._refuse_directed("triangles")
        if triangles is None or (isinstance(triangles, str) and triangles == "none"):
            return self._with(triangles=None)
        if isinstance(triangles, str):
            if triangles != "cliques":
                raise BadInput(f'triangles = "{triangles}": allowed are "cliques" and "none"')
            return self._with(triangles=hodge.cliques(self.n_nodes, self.links))
        checked = checks.checked_triangles(self.n_nodes, triangles, self.links)
        return self._with(triangles=checked)

    def with_groups(self, groups: ArrayLike | None) -> Self:
        """Return the network with the number of each node's community, shape (N0,)."""
        checked = None if groups is None else checks.checked_labels("groups", groups, self.n_nodes)
        return self._with(groups=checked)

    def with_order(self, order: ArrayLike | None) -> Self:
        """Return the network with an order of its nodes for pictures and chains, shape (N0,).

        Raises
        ------
        BadInput
            Unless the order names every node once.
        """
        checked = None if order is None else checks.checked_order(order, self.n_nodes)
        return self._with(node_order=checked)

    def relabel(self, new: ArrayLike) -> Self:
        """Return the network with node i called ``new[i]``; links keep their order."""
        names = checks.checked_order(new, self.n_nodes)
        old = np.argsort(names)
        return self._with(
            links=names[self.links],
            triangles=None if self.triangles is None else names[self.triangles],
            groups=None if self.groups is None else self.groups[old],
            node_order=None if self.node_order is None else names[self.node_order],
            half_degree=0,
        )

    def reorient(self, links: Integers) -> Self:
        """Reverse the links with the given indices."""
        self._refuse_directed("reorientation")
        check_indices("link", links, self.n_links)
        turned = self.links.copy()
        turned[links] = turned[links, ::-1]
        return self._with(links=turned)

    def reorient_random(
        self,
        count: int,
        seed: int | np.random.Generator = 0,
        among: Integers | None = None,
    ) -> Self:
        """Reverse ``count`` different links drawn uniformly (the paper's Q_r, app. E).

        They are drawn from all links, or from the links with indices ``among``.

        Raises
        ------
        BadInput
            Unless 0 <= count <= N1, or <= the number of ``among`` if given.
        """
        n_links = self.n_links if among is None else len(among)
        if not 0 <= count <= n_links or count != int(count):
            where = f"of the {self.kind}" if among is None else "to draw from"
            raise BadInput(f"flips = {count}: allowed is 0 to the {n_links} links {where}")
        drawn = generator(seed).choice(n_links, int(count), replace=False)
        return self.reorient(drawn if among is None else among[drawn])

    # -- matrices --------------------------------------------------------------------------------

    def boundary(self, k: int) -> csr_array:
        r"""Boundary matrix B_k, SciPy sparse: of links (k = 1) or triangles (k = 2).

        B_1 has shape (N0, N1), with +1 at the head and -1 at the tail of each link. B_2 has shape
        (N1, N2), with +1 where a link points along the triangle and -1 where it points against it.
        B_1 B_2 = 0. Link weights W enter symmetrically,

        .. math::
            \hat B_1 = B_1 W^{1/2}, \qquad \hat B_2 = W^{-1/2} B_2,

        so that :math:`\hat B_1 \hat B_1^\top` is the weighted graph Laplacian and
        :math:`\hat B_1 \hat B_2 = 0`.

        Raises
        ------
        BadInput
            Another k, a directed network, a negative weight, or a link of weight 0 in a triangle.
        """
        if k not in (1, 2):
            raise BadInput(f"boundary({k}): allowed are 1 (links) and 2 (triangles)")
        return self._boundary_of_links if k == 1 else self._boundary_of_triangles

    @cached_property
    def _boundary_of_links(self) -> csr_array:
        self._refuse_directed("a boundary matrix")
        if self.weights is not None and (self.weights < 0.0).any():
            index = int(np.argmax(self.weights < 0.0))
            raise BadInput(
                f"the weight of link {index} is {self.weights[index]}: "
                "boundary matrices need weights >= 0"
            )
        return hodge.boundary_of_links(self.n_nodes, self.links, self.weights)

    @cached_property
    def _boundary_of_triangles(self) -> csr_array:
        from scipy.sparse import csr_array

        self.boundary(1)  # its checks
        if self.triangles is None:
            return csr_array((self.n_links, 0))
        return hodge.boundary_of_triangles(self.n_nodes, self.links, self.triangles, self.weights)

    def dirac(self, k: int = 0) -> csr_array:
        r"""D = [B_k^T, B_{k+1}], shape (N_k, N_{k-1} + N_{k+1}), CSR with sorted columns.

        It takes the linear signals, those on the lower simplices followed by those on the higher
        ones, to the simplices of dimension k. D = B_1 for k = 0.

        Raises
        ------
        BadInput
            As `boundary`, and unless k is 0, 1 or 2.
        """
        from scipy.sparse import csr_array, hstack

        if k not in (0, 1, 2):
            raise BadInput(f"k = {k}: allowed are 0 (nodes), 1 (links) and 2 (triangles)")
        if k not in self._diracs:
            lower = [csr_array(self.boundary(k).T)] if k > 0 else []
            parts = lower + ([self.boundary(k + 1)] if k < 2 else [])
            self._diracs[k] = hodge.in_order(csr_array(hstack(parts, format="csr")))
        return self._diracs[k]

    @cached_property
    def _diracs(self) -> dict[int, csr_array]:
        return {}

    def laplacian(self, k: int = 0) -> csr_array:
        r"""Hodge Laplacian L_k = B_k^T B_k + B_{k+1} B_{k+1}^T, CSR with sorted columns.

        L_k = D D^T with D = `dirac` (k); L_0 is the (weighted) graph Laplacian. Raises as `dirac`.
        """
        from scipy.sparse import csr_array

        if k not in self._laplacians:
            d = self.dirac(k)
            self._laplacians[k] = hodge.in_order(csr_array(d @ d.T))
        return self._laplacians[k]

    @cached_property
    def _laplacians(self) -> dict[int, csr_array]:
        return {}

    def source(self, k: int = 0) -> Array:
        """s_k = D 1 with D = `dirac` (k), shape (N_k,): what constant linear signals add up to."""
        if k == 0:
            return self.divergence
        return np.asarray(self.dirac(k).sum(axis=1), dtype=np.float64)

    @property
    def incidence(self) -> csr_array:
        """Incidence matrix B_1, SciPy sparse, shape (N0, N1): +1 at heads, -1 at tails."""
        return self.boundary(1)

    @cached_property
    def divergence(self) -> Array:
        """Net divergence s = B_1 1 of each node, shape (N0,): links in minus links out.

        Of a weighted network, each link counts with the square root of its weight, as in B_1.
        """
        if self.weights is not None or self.directed:
            return np.asarray(self.boundary(1).sum(axis=1), dtype=np.float64)
        arriving = np.bincount(self.links[:, 1], minlength=self.n_nodes)
        leaving = np.bincount(self.links[:, 0], minlength=self.n_nodes)
        return (arriving - leaving).astype(np.float64)

    @cached_property
    def adjacency(self) -> csr_array:
        """Coupling matrix A, CSR, shape (N0, N0): A[i, j] is the weight of the link from j to i.

        A is symmetric unless the network is directed. Weights may have any sign.
        """
        return hodge.adjacency(self.n_nodes, self.links, self.weights, self.directed)

    @cached_property
    def neighbour_mean(self) -> csr_array:
        """A over the degree, CSR, shape (N0, N0): the mean over the (weighted) links of a node.

        Raises
        ------
        BadInput
            A node without links, or with weights whose sum is zero.
        """
        return hodge.mean_of_rows(self.adjacency)

    # -- signals ---------------------------------------------------------------------------------

    def gather_links(self, v: Array) -> Array:
        """B_1 v, the divergence of link signals v (N1, ...) at the nodes; returns (N0, ...)."""
        gathered: Array = self.incidence @ v
        return gathered

    def spread_to_links(self, u: Array) -> Array:
        """B_1^T u: differences head - tail of node signals u (N0, ...); returns (N1, ...)."""
        differences: Array = u[self.links[:, 1]] - u[self.links[:, 0]]
        if self.weights is None:
            return differences
        return differences * np.sqrt(self.weights).reshape(-1, *[1] * (u.ndim - 1))

    def solve_laplacian(self, w: Array, k: int = 0) -> Array:
        """L_k^+ w for signals w (N_k, ...): the solution of least norm.

        The part of w in the kernel of L_k is left out; for k = 0 and a connected network this is
        the mean of w.
        """
        return hodge.pseudo_solve(self.laplacian(k), w)

    def cycle_part(self, v: Array, k: int = 0) -> Array:
        """Projection of linear signals v (N_{k-1} + N_{k+1},) on the kernel of D = `dirac` (k).

        For k = 0 this is the cycle space of link signals v (N1,).
        """
        if k == 0:
            return v - self.spread_to_links(self.solve_laplacian(self.gather_links(v)))
        d = self.dirac(k)
        projected: Array = v - d.T @ self.solve_laplacian(d @ v, k)
        return projected

    @cached_property
    def betti(self) -> tuple[int, int, int]:
        """Betti numbers (components, cycles that bound no triangles, cavities) of small networks.

        Raises
        ------
        BadInput
            More than `MOST_RANKED` links or triangles.
        """
        if self.n_triangles and max(self.n_links, self.n_triangles) > MOST_RANKED:
            raise BadInput(
                f"betti: {self.n_links} links and {self.n_triangles} triangles; "
                f"at most {MOST_RANKED} are allowed"
            )
        b_0 = self.n_components
        bounded = hodge.rank(self.boundary(2))
        return b_0, self.n_links - (self.n_nodes - b_0) - bounded, self.n_triangles - bounded

    @property
    def n_components(self) -> int:
        """Number of connected components."""
        return int(hodge.components(self.n_nodes, self.links).max()) + 1

    def _refuse_directed(self, what: str) -> None:
        if self.directed:
            raise BadInput(
                f"a directed network has no orientation, which {what} needs: "
                "read it with directed=False to take the directions as orientations"
            )


def dimension(signals: str) -> int:
    """Return k of "nodes" (0), "links" (1) or "triangles" (2). Raises BadInput for other words."""
    if signals not in SIGNALS:
        raise BadInput(f'signals = {signals!r}: allowed are "nodes", "links" and "triangles"')
    return SIGNALS.index(signals)
