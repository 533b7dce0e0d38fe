"""Networks from and to networkx, XGI, matrices and files: orientations survive every round trip."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import networkx
import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from network_tools import complexes, random_complex, refusal
from scipy import sparse

from chimera_hpc import Network
from chimera_hpc.base.errors import BadInput


def same(first: Network, second: Network) -> None:
    """Links, orientations, triangles and groups are equal; weights to rounding."""
    assert first.n_nodes == second.n_nodes
    for name in ("links", "triangles", "groups"):
        one, two = getattr(first, name), getattr(second, name)
        if name == "triangles":
            one, two = (np.empty((0, 3)) if x is None else x for x in (one, two))
        np.testing.assert_array_equal(one, two, err_msg=name)
    assert (first.weights is None) == (second.weights is None) or not first.n_links
    if first.weights is not None and second.weights is not None:
        np.testing.assert_allclose(first.weights, second.weights, rtol=1e-15)


def rotated(network: Network) -> Network:
    """The same network with the nodes of each triangle turned so that the matrices' sides agree."""
    return Network.from_matrices(B1=network.boundary(1), B2=network.boundary(2))


@given(complexes())
def test_networkx_keeps_everything(network: Network) -> None:
    network = network.with_groups(np.arange(network.n_nodes) % 3)
    same(Network.from_networkx(network.to_networkx()), network)


@given(complexes())
def test_matrices_keep_everything(network: Network) -> None:
    again = rotated(network)
    np.testing.assert_array_equal(again.links, network.links)
    for k in (1, 2):
        difference = again.boundary(k) - network.boundary(k)
        assert abs(difference).max() < 1e-15 if difference.nnz else True
    dense = Network.from_matrices(B1=network.boundary(1).toarray())
    np.testing.assert_array_equal(dense.links, network.links)


@given(complexes())
def test_adjacency_keeps_links_and_weights(network: Network) -> None:
    again = Network.from_matrices(adjacency=network.adjacency)
    np.testing.assert_array_equal(again.adjacency.toarray(), network.adjacency.toarray())
    assert (again.links[:, 0] < again.links[:, 1]).all()
    assert not again.directed


@given(complexes(weights=False))
def test_lists_of_edges_keep_everything_but_triangles(network: Network) -> None:
    again = Network.from_edges(network.links, network.n_nodes)
    np.testing.assert_array_equal(again.links, network.links)


class Simplices:
    """What `from_xgi` uses of an XGI SimplicialComplex."""

    def __init__(self, nodes: list[str], simplices: dict[str, set[str]]) -> None:
        self.nodes = nodes
        self.edges = self
        self.simplices = simplices

    def __iter__(self) -> Iterator[str]:
        return iter(self.simplices)

    def members(self, name: str) -> set[str]:
        return self.simplices[name]


def test_xgi_orientations_turn_sorted_simplices() -> None:
    simplices = Simplices(
        ["c", "a", "b"],
        {"ab": {"a", "b"}, "abc": {"a", "b", "c"}, "ac": {"a", "c"}, "bc": {"b", "c"}},
    )
    plain = Network.from_xgi(simplices)
    assert plain.links.tolist() == [[1, 2], [1, 0], [2, 0]]
    assert plain.triangles is not None
    assert plain.triangles.tolist() == [[1, 2, 0]]
    turned = Network.from_xgi(simplices, {"ab": 1, "ac": 0, "bc": 0, "abc": 1})
    assert turned.links.tolist() == [[2, 1], [1, 0], [2, 0]]
    np.testing.assert_array_equal(turned.boundary(2).toarray(), [[1.0], [1.0], [-1.0]])


@pytest.mark.parametrize("seed", range(5))
def test_xgi_has_the_same_boundaries(seed: int) -> None:
    xgi = pytest.importorskip("xgi")
    network = random_complex(seed, 8, 0.6, weights=False)
    simplices, orientations = network.to_xgi()
    for k in (1, 2):
        expected = xgi.boundary_matrix(simplices, k, orientations)
        np.testing.assert_array_equal(network.boundary(k).toarray(), expected)
    again = Network.from_xgi(simplices, orientations)
    assert again.boundary(2).toarray().tolist() == network.boundary(2).toarray().tolist()


def test_a_graph_of_names_is_numbered_in_its_order() -> None:
    graph = networkx.Graph()
    graph.add_edge("b", "a", weight=2.0)
    graph.add_edge("a", "c")
    for node, side in (("a", "left"), ("b", "right"), ("c", "left")):
        graph.nodes[node]["side"] = side
    network = Network.from_networkx(graph, group="side")
    assert network.links.tolist() == [[0, 1], [1, 2]]
    assert network.weights is not None
    assert network.weights.tolist() == [2.0, 1.0]
    assert network.communities.tolist() == [1, 0, 0]


def test_directions_are_kept_or_become_orientations() -> None:
    graph = networkx.DiGraph([(1, 0), (1, 2)])
    directed = Network.from_networkx(graph)
    assert directed.directed
    same(Network.from_networkx(directed.to_networkx()), directed)
    oriented = Network.from_networkx(graph, directed=False)
    assert oriented.links.tolist() == [[0, 1], [0, 2]]
    assert oriented.divergence.tolist() == [-2.0, 1.0, 1.0]
    lopsided = Network.from_matrices(adjacency=[[0, 2.0], [0, 0]])
    assert lopsided.directed
    assert lopsided.links.tolist() == [[1, 0]]


def write_npz(path: Path, network: Network) -> None:
    arrays = {"B1": network.boundary(1).toarray(), "B2": network.boundary(2).toarray()}
    np.savez(path, **arrays)


def write_mat(path: Path, network: Network) -> None:
    scipy.io.savemat(path, {"B1": network.boundary(1), "B2": network.boundary(2)})


def write_edges(separator: str) -> Callable[[Path, Network], None]:
    def write(path: Path, network: Network) -> None:
        assert network.weights is not None
        rows = zip(network.links.tolist(), network.weights.tolist(), strict=True)
        lines = [separator.join([str(a), str(b), repr(w)]) for (a, b), w in rows]
        path.write_text("\n".join([separator.join(("source", "target", "weight")), *lines]))

    return write


def write_json(path: Path, network: Network) -> None:
    path.write_text(json.dumps(networkx.node_link_data(network.to_networkx(), edges="links")))


def through_networkx(write: Callable[[Any, Path], None]) -> Callable[[Path, Network], None]:
    def write_graph(path: Path, network: Network) -> None:
        write(network.with_triangles("none").to_networkx(), path)

    return write_graph


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.csv", write_edges(",")),
        ("a.tsv", write_edges("\t")),
        ("a.txt", write_edges(" ")),
        ("a.graphml", through_networkx(networkx.write_graphml)),
        ("a.gml", through_networkx(networkx.write_gml)),
        ("a.json", write_json),
        ("a.npz", write_npz),
        ("a.mat", write_mat),
    ],
)
def test_files_keep_orientations_and_weights(
    tmp_path: Path, name: str, write: Callable[[Path, Network], None]
) -> None:
    network = random_complex(3, 9, 0.6)
    write(tmp_path / name, network)
    again = Network.from_file(tmp_path / name, n_nodes=9)
    np.testing.assert_array_equal(again.links, network.links)
    assert again.weights is not None
    np.testing.assert_allclose(again.weights, network.weights, rtol=1e-14)
    if name in ("a.json", "a.npz", "a.mat"):
        difference = abs(again.boundary(2) - network.boundary(2))
        assert difference.max() < 1e-14


def matrix_files(folder: Path, matrix: Any) -> Iterator[Path]:
    np.save(folder / "a.npy", matrix)
    sparse.save_npz(folder / "sparse.npz", sparse.csr_array(matrix))
    np.savez(folder / "named.npz", adjacency=matrix, other=np.zeros(3))
    scipy.io.mmwrite(folder / "a.mtx", sparse.coo_array(matrix))
    scipy.io.savemat(folder / "a.mat", {"connectivity": matrix, "names": np.zeros((2, 3))})
    np.savetxt(folder / "square.csv", matrix, delimiter=",")
    for name in ("a.npy", "sparse.npz", "named.npz", "a.mtx", "a.mat", "square.csv"):
        yield folder / name


def test_adjacency_matrices_of_all_formats_are_read(tmp_path: Path) -> None:
    network = random_complex(4, 7, 0.6)
    for path in matrix_files(tmp_path, network.adjacency.toarray()):
        again = Network.from_file(path)
        np.testing.assert_array_equal(again.adjacency.toarray(), network.adjacency.toarray())


def test_an_incidence_matrix_is_not_square(tmp_path: Path) -> None:
    network = random_complex(4, 7, 0.6, weights=False)
    np.save(tmp_path / "b.npy", network.boundary(1).toarray())
    np.testing.assert_array_equal(Network.from_file(tmp_path / "b.npy").links, network.links)


def test_parts_saved_by_numpy_are_read(tmp_path: Path) -> None:
    network = random_complex(5)
    assert network.weights is not None
    assert network.triangles is not None
    names = ("n_nodes", "links", "weights", "triangles")
    np.savez(tmp_path / "a.npz", **{name: getattr(network, name) for name in names})
    same(Network.from_file(tmp_path / "a.npz"), network)


def test_links_saved_by_numpy_have_directions_if_asked_for(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", links=[[0, 1], [1, 0], [1, 2]])
    network = Network.from_file(tmp_path / "a.npz", directed=True)
    assert network.adjacency.toarray().tolist() == [[0, 1, 0], [1, 0, 0], [0, 1, 0]]


def test_lists_of_names_are_numbered_as_they_appear(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("# a comment\nlondon;paris\nparis;rome # another\n\n")
    assert Network.from_file(path).links.tolist() == [[0, 1], [1, 2]]
    assert Network.from_file(path, directed=True).directed


def text_file(name: str, text: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        (folder / name).write_text(text)
        return Network.from_file(folder / name, n_nodes=3)

    return read


def array_file(name: str, array: Any) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        np.save(folder / name, np.array(array))
        return Network.from_file(folder / name)

    return read


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (text_file("a.xls", ""), "a network file ends with one of .csv, .tsv"),
        (lambda folder: Network.from_file(folder / "no.csv"), "No such file or directory"),
        (text_file("a.csv", "0,1\n1,2\n2,3"), " has 4 nodes, but n_nodes = 3"),
        (text_file("a.csv", "0,1\n1,2,3"), "line 2 has 3 cells: every line has tail, head and"),
        (text_file("a.csv", "0,1,x\n1,2,3"), "line 1: 'x' is not a number"),
        (text_file("a.csv", "0,1,1.0\n1,2,nan"), "the weight of link 1 is nan: weights must be"),
        (text_file("a.csv", "0,1\n1,0"), "link 1 (nodes 1, 0) repeats link 0"),
        (text_file("a.csv", "0,1\n2,2"), "link 1 from node 2 to node 2: a link joins two"),
        (text_file("a.graphml", "<graphml"), "cannot be read as a network: "),
        (text_file("a.gml", "graph ["), "cannot be read as a network: "),
        (text_file("a.json", "[1]"), 'expected is an object with "nodes" and "links"'),
        (
            text_file("a.json", '{"nodes":[{"id":0}],"links":[{"source":0,"target":"5"}]}'),
            "node '5' of a link is not among \"nodes\"",
        ),
        (text_file("a.json", "{"), "cannot be read as a network: "),
        (text_file("a.npz", "nothing"), "cannot be read as a network: "),
        (text_file("a.mat", "nothing"), "cannot be read as a network: "),
        (text_file("a.mtx", "nothing"), "cannot be read as a network: "),
        (array_file("a.npy", np.eye(3)), "link 0 from node 0 to node 0: a link joins two"),
        (array_file("a.npy", [1.0, 2.0]), "adjacency has shape (2,)"),
        (array_file("a.npy", [["x", "y"]]), "is no matrix of numbers"),
        (array_file("a.npy", np.array([{}])), "cannot be read as a network: "),
        (array_file("a.npy", [[0, np.nan], [np.nan, 0]]), "adjacency[0, 1] is nan"),
        (array_file("a.npy", [[1, 1, 0], [-1, 1, 0]]), "column 1 of B1: a link has two entries"),
    ],
)
def test_files_that_are_no_network_are_refused_in_one_line(
    tmp_path: Path, read: Callable[[Path], object], message: str
) -> None:
    with pytest.raises(BadInput) as caught:
        read(tmp_path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path))
    assert "\n" not in str(caught.value)


B1 = [[-1, 0, -1, 0], [1, -1, 0, -1], [0, 1, 1, 0], [0, 0, 0, 1]]
BY_MATRICES = Network.from_matrices
MULTI = networkx.MultiGraph([(0, 1), (0, 1)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: BY_MATRICES(B1=B1, B2=[[1, 1], [1, 1], [-1, 1], [0, 0]]),
            "triangle 1 (links 0, 1, 2) of B2: its links do not close, B1 B2 is not 0",
        ),
        (
            lambda: BY_MATRICES(B1=B1, B2=[[1], [1], [0], [0]]),
            "triangle 0 (links 0, 1) of B2: its links do not close",
        ),
        (
            lambda: BY_MATRICES(B1=B1, B2=[[2], [2], [-2], [0]]),
            "triangle 0 of B2 has a weight: triangles cannot have weights",
        ),
        (lambda: BY_MATRICES(B1=B1, B2=[[1], [1], [-1]]), "B2 has 3 rows: B1 has 4 links"),
        (lambda: BY_MATRICES(B1=[[1], [-2]]), "column 0 of B1: a link has two entries"),
        (lambda: BY_MATRICES(B1=[["a"]]), "B1 is no matrix of numbers"),
        (lambda: BY_MATRICES(), "from_matrices needs B1 (and perhaps B2) or adjacency"),
        (lambda: BY_MATRICES(adjacency=[[0, 1, 0]]), "adjacency has shape (1, 3): it must be"),
        (
            lambda: BY_MATRICES(adjacency=[[0, 1], [0, 0]], directed=False),
            "adjacency is not symmetric: it is of a directed network",
        ),
        (lambda: Network.from_networkx(MULTI), "a multigraph may link two nodes several times"),
        (
            lambda: Network.from_networkx(networkx.Graph([(0, 1, {"weight": "x"})])),
            "weight of the edge 0 - 1 is 'x': not a number",
        ),
        (lambda: Network.from_networkx(networkx.Graph()), "n_nodes = 0: allowed are whole"),
        (lambda: BY_MATRICES(adjacency=[[0, 1j], [1j, 0]]), "adjacency holds complex numbers"),
        (lambda: Network.from_edges([(0, 10**9)]), "node 1000000000: nodes count from 0"),
    ],
)
def test_what_is_no_network_is_refused_in_one_line(
    make: Callable[[], object], message: str
) -> None:
    assert refusal(make).startswith(message)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "New York,Los Angeles\nLos Angeles, San Juan\n"),
        ("a.csv", '"New York, NY",Los Angeles\nLos Angeles,San Juan\n'),
        ("a.tsv", "source\ttarget\nNew York\tLos Angeles\nLos Angeles\tSan Juan\n"),
        ("a.txt", "1 , 2\n2;3\n"),
        (
            "a.json",
            '{"nodes":[{"id":7},{"id":5},{"id":6}],"links":[{"source":7,"target":5},'
            '{"source":5,"target":6}]}',
        ),
    ],
)
def test_names_may_hold_blanks_and_json_need_not_say_what_it_is(
    name: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    links = Network.from_file(tmp_path / name).links
    first = 1 if name == "a.txt" else 0
    np.testing.assert_array_equal(links, [[first, first + 1], [first + 1, first + 2]])


@pytest.mark.parametrize("text", ["", "# nothing\n", "source,target\n"])
def test_list_without_links_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    assert refusal(lambda: Network.from_file(tmp_path / "a.csv")).endswith("holds no links")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,-1\n", "node -1: nodes are whole numbers"),
        ("0,1.5\n", "node 1.5: nodes are whole numbers"),
        ("0,nan\n", "node nan: nodes are whole numbers"),
        ("0,4000000000\n", "node 4000000000: nodes count from 0, up to 9999999"),
        ("0,99999999999999999999\n", "node 100000000000000000000: nodes count from 0"),
    ],
)
def test_numbers_that_no_node_has_are_not_taken_for_names(
    text: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text(text)
    assert message in refusal(lambda: Network.from_file(tmp_path / "a.csv"))


def test_whole_numbers_may_be_written_as_floats(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.txt", [[2, 1], [1, 0]])
    links = Network.from_file(tmp_path / "a.txt").links
    np.testing.assert_array_equal(links, [[2, 1], [1, 0]])


@given(st.text(alphabet="01, \n;#ab.-", max_size=40))
def test_any_text_is_read_or_refused_as_bad_input(text: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.csv")
        path.write_text(text)
        try:
            message = f"{Network.from_file(path).n_nodes} nodes"
        except BadInput as error:
            message = str(error)
        assert "\n" not in message
