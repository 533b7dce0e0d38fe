"""Agreement between measures in words, for the terminal and the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Agreement = Mapping[str, Any]

CAPTION = "Cohen's kappa of the runs below the diagonal, adjusted Rand index above it"
_MOST_CELLS = 20


def matrix(entry: Agreement) -> tuple[list[str], list[list[float | None]]]:
    """Return the names of k measures and their matrix (k, k), as `CAPTION` says.

    None stands where a number is not defined, and on the diagonal.
    """
    names = list(entry["modal"])
    made: list[list[float | None]] = [[None] * len(names) for _ in names]
    for pair in entry["pairs"]:
        i, j = names.index(pair["rows"]), names.index(pair["columns"])
        made[j][i], made[i][j] = pair["kappa"], pair.get("adjusted_rand")
    return names, made


def matrix_rows(entry: Agreement) -> list[tuple[str, ...]]:
    """Return the table in words: a head, and a row for each measure."""
    names, made = matrix(entry)
    rows = [
        (name, *("" if i == j else "-" if x is None else f"{x:.2f}" for j, x in enumerate(row)))
        for i, (name, row) in enumerate(zip(names, made, strict=True))
    ]
    return [("", *names), *rows]


def cluster_lines(curves: Mapping[str, Any]) -> list[str]:
    """Return what analyses found of the number of classes, and of other classifiers."""
    lines = [curves["number-of-classes"]["sentence"]] if "number-of-classes" in curves else []
    for pair in curves.get("classifiers", {"pairs": []})["pairs"]:
        index = pair["adjusted_rand"]
        text = "not defined" if index is None or index != index else f"{index:.2f}"
        lines.append(f"{pair['rows']} and {pair['columns']}: adjusted Rand index {text}")
    return lines


def agreement_lines(entry: Agreement) -> list[str]:
    """Return the caption, the table, and how many cells the measures differ in."""
    rows = matrix_rows(entry)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    head, *numbers = (
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )
    return [f"{CAPTION}:", head, *numbers, *remarks(entry), differing_line(entry)]


def remarks(entry: Agreement) -> list[str]:
    """Return remarks on the numbers, one per line; results of earlier versions have none."""
    return [entry["remark"]] if entry.get("remark") else []


def differing_line(entry: Agreement) -> str:
    """Return in how many cells the modal classes differ."""
    return f"the measures differ in {len(entry['differing'])} of {len(entry['cells'])} cells"


def differing_rows(entry: Agreement) -> list[tuple[str, ...]]:
    """Return a head, and for each of the first cells that differ its place and its classes."""
    names, cells = list(entry["modal"]), entry["differing"][:_MOST_CELLS]
    varying = [
        key
        for key in (entry["cells"][0] if entry["cells"] else {})
        if len({cell[key] for cell in entry["cells"]}) > 1
    ]
    head = (", ".join(varying) or "cell", *names)
    places = [", ".join(f"{cell[key]:g}" for key in varying) for cell in cells]
    rows = [
        (place, *(cell[name] or "-" for name in names))
        for place, cell in zip(places, cells, strict=True)
    ]
    return [head, *rows]
