"""Networks from files: lists of edges, GraphML, GML, JSON, and matrices of NumPy, SciPy, MATLAB."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.network import interchange
from chimera_hpc.network.generators import Parts

ADJACENCY = ("adjacency", "A", "weights", "connectivity", "sc", "W")
"""Names of a matrix in an .npz or .mat file with several arrays."""


def read_parts(path: str | Path, directed: bool | None) -> Parts:
    """Return the parts of the network in a file, by the ending of its name.

    Raises BadInput, which begins with the path: no such file, an ending that is not known, or
    contents that are no network.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise BadInput(f"{path}: a network file ends with one of {', '.join(READERS)}")
    try:
        return reader(path, directed)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}") from None
    except Exception as error:  # whatever a reader of another package meets in a broken file
        text = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{path}: cannot be read as a network: {text}") from None


def _edge_list(path: Path, directed: bool | None) -> Parts:
    """Read rows of tail, head and perhaps a weight, between commas, semicolons, tabs or blanks.

    A square table of more than three columns is an adjacency matrix.
    """
    rows = _rows(path.read_text(encoding="utf-8-sig").splitlines())
    if rows and _is_header(rows[0][1]):
        rows = rows[1:]
    if len(rows) > 3 and {len(cells) for _, cells in rows} == {len(rows)}:
        matrix = [[_weight(number, cell) for cell in cells] for number, cells in rows]
        return interchange.from_adjacency(np.array(matrix), directed)
    if not rows:
        raise BadInput("holds no links")
    for number, cells in rows:
        if len(cells) not in (2, 3) or len(cells) != len(rows[0][1]):
            raise BadInput(
                f"line {number} has {len(cells)} cells: every line has tail, head and, on all "
                "lines or on none, a weight"
            )
    names = _numbers([name for _, cells in rows for name in cells[:2]])
    weights = None
    if len(rows[0][1]) == 3:
        weights = np.array([_weight(number, cells[2]) for number, cells in rows])
    edges = np.array(names, dtype=np.int64).reshape(-1, 2)
    return interchange.from_edges(edges, None, weights, bool(directed))


def _rows(lines: list[str]) -> list[tuple[int, list[str]]]:
    """Return the number of each line that is not empty, and its cells.

    Numbers may have any mixture of separators between them. Names may hold blanks where all lines
    have a tab, a semicolon or a comma, and any of these between quotes.
    """
    texts = [(number, line.partition("#")[0].strip()) for number, line in enumerate(lines, start=1)]
    texts = [(number, text) for number, text in texts if text]
    cells = [re.split(r"[,;\t]|\s+", text) for _, text in texts]
    if not all(map(_is_number, filter(None, chain(*cells[1:])))):
        sign = next((s for s in "\t;," if all(s in text for _, text in texts)), None)
        if sign is not None:
            cells = [_quoted(text, sign) for _, text in texts]
    return [
        (number, [cell.strip().strip('"') for cell in row if cell.strip()])
        for (number, _), row in zip(texts, cells, strict=True)
    ]


def _quoted(line: str, sign: str) -> list[str]:
    return next(csv.reader([line], delimiter=sign, skipinitialspace=True))


def _is_number(text: str) -> bool:
    return (
        re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|nan|inf", text.strip('"')) is not None
    )


def _is_header(cells: list[str]) -> bool:
    """Tell a line of headings by its first two words."""
    words = {"source", "target", "tail", "head", "from", "to", "node1", "node2", "i", "j", "u", "v"}
    return {cell.lower() for cell in cells[:2]} <= words


def _numbers(names: list[str]) -> list[int]:
    """Return whole numbers as they are, and names numbered as they first appear."""
    if all(map(_is_number, names)):
        for name in names:
            if not (float(name) >= 0.0 and float(name).is_integer()):
                raise BadInput(f"node {name}: nodes are whole numbers from 0, or names")
        found = [int(float(name)) for name in names]
        interchange.numbered(max(found))
        return found
    place: dict[str, int] = {}
    return [place.setdefault(name, len(place)) for name in names]


def _weight(number: int, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"line {number}: {text!r} is not a number") from None


def _graphml(path: Path, directed: bool | None) -> Parts:
    from networkx import read_graphml

    return _graph(read_graphml(path), directed)


def _gml(path: Path, directed: bool | None) -> Parts:
    from networkx import read_gml

    return _graph(read_gml(path, label=None), directed)


def _json(path: Path, directed: bool | None) -> Parts:
    from networkx import node_link_graph

    data = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(data, dict) or "nodes" not in data:
        raise BadInput('expected is an object with "nodes" and "links" or "edges" (node-link)')
    data.setdefault("multigraph", False)  # as of D3 and others, which do not say
    graph = node_link_graph(data, edges="edges" if "edges" in data else "links")
    # The package adds nodes that only a link names.
    if unknown := list(graph)[len(data["nodes"]) :]:
        raise BadInput(f'node {unknown[0]!r:.60} of a link is not among "nodes"')
    return _graph(graph, directed)


def _graph(graph: Any, directed: bool | None) -> Parts:
    return interchange.from_networkx(graph, "weight", interchange.GROUP, directed)


def _npy(path: Path, directed: bool | None) -> Parts:
    return _matrices({"adjacency": np.load(path, allow_pickle=False)}, directed)


def _npz(path: Path, directed: bool | None) -> Parts:
    from scipy.sparse import load_npz

    with np.load(path, allow_pickle=False) as arrays:
        if "format" not in arrays:
            return _matrices({name: arrays[name] for name in arrays.files}, directed)
    return _matrices({"adjacency": load_npz(path)}, directed)


def _mtx(path: Path, directed: bool | None) -> Parts:
    from scipy.io import mmread

    return _matrices({"adjacency": mmread(path, spmatrix=False)}, directed)


def _mat(path: Path, directed: bool | None) -> Parts:
    from scipy.io import loadmat

    try:
        arrays = loadmat(path, spmatrix=False)
    except NotImplementedError:
        raise BadInput('is a MATLAB file of version 7.3: save it with "-v7"') from None
    named = {name: value for name, value in arrays.items() if not name.startswith("__")}
    return _matrices(named, directed)


def _matrices(arrays: dict[str, Any], directed: bool | None) -> Parts:
    """Return the parts of B1 (and B2), of an adjacency matrix, or of the only matrix that is."""
    if "B1" in arrays:
        return interchange.from_boundaries(arrays["B1"], arrays.get("B2"))
    if "links" in arrays:
        parts = interchange.from_edges(arrays["links"], None, None, bool(directed))
        if "n_nodes" in arrays:
            parts["n_nodes"] = int(np.max(arrays["n_nodes"]))
        more = ("weights", "triangles", "groups")
        return parts | {name: arrays[name] for name in more if name in arrays}
    found = [name for name in ADJACENCY if name in arrays] or list(arrays)
    if len(found) != 1 and not (found and found[0] in ADJACENCY):
        raise BadInput(f"has the arrays {', '.join(arrays)}: call one of them adjacency or B1")
    matrix = arrays[found[0]]
    rows, columns = matrix.shape if len(matrix.shape) == 2 else (0, 0)
    if rows != columns:
        return interchange.from_boundaries(matrix, None)
    return interchange.from_adjacency(matrix, directed)


READERS: dict[str, Callable[[Path, bool | None], Parts]] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".edges", ".edgelist"), _edge_list),
    ".graphml": _graphml,
    ".gml": _gml,
    ".json": _json,
    ".npy": _npy,
    ".npz": _npz,
    ".mtx": _mtx,
    ".mat": _mat,
}
