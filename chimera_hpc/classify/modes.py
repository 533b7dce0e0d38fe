"""The modal class of each cell (paper, sec. III C: the statistical mode over the seeds)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Cut
from chimera_hpc.classify.naming import NO_WINDOW as NO_WINDOW
from chimera_hpc.classify.naming import STEADY as STEADY
from chimera_hpc.classify.tree import Floats, Integers


class CellTable(Protocol):
    """What this module needs of a list of points."""

    def cells(self) -> tuple[NDArray[np.int64], Mapping[str, NDArray[Any]]]:
        """Return the cell of each point (n,) and the columns that name the cells (n_cells,)."""
        ...


def modal_classes(points: CellTable, status: ArrayLike, cut: Cut) -> list[dict[str, Any]]:
    """Describe each cell by its coordinates and by its modal class.

    The other keys are ``class``, ``oscillating``, ``votes`` and ``entropy_bits``. Every run with a
    result has one vote: its class, ``steady``, or ``no_window`` (it varies, but too slowly or too
    coarsely sampled to be classified). The modal class is taken over the runs that have a class:
    those that oscillate, and with ``steady = "level"`` the others too. ``oscillating`` is the share
    of the runs that oscillate. Ties go to the class with more members in the whole cut, then to the
    first in its order. A cell whose runs have no class is ``steady`` if most of them are, else
    ``no_window``. A cell without a result has class None, share None and no votes. The entropy
    -sum p log2 p is that of the votes.
    """
    cell_of_point, columns = points.cells()
    n_cells = max((len(column) for column in columns.values()), default=0)
    names = [*cut.names, STEADY, NO_WINDOW]
    votes = count_votes(cell_of_point, vote_labels(cut.labels, status, len(cut.names)), n_cells)
    votes = np.pad(votes, ((0, 0), (0, len(names) - votes.shape[1])))
    modal = modal_votes(votes, cut.sizes)
    moving = np.bincount(cell_of_point[np.asarray(status) == Status.DONE], minlength=n_cells)
    shares = moving / np.maximum(votes.sum(axis=1), 1)
    entropy = entropy_bits(votes)
    found = []
    for i in range(n_cells):
        cell: dict[str, Any] = {name: column[i].item() for name, column in columns.items()}
        cell["class"] = names[modal[i]] if modal[i] >= 0 else None
        cell["oscillating"] = float(shares[i]) if modal[i] >= 0 else None
        cell["votes"] = {names[j]: int(votes[i, j]) for j in np.flatnonzero(votes[i])}
        cell["entropy_bits"] = float(entropy[i])
        found.append(cell)
    return found


def vote_labels(labels: Integers, status: ArrayLike, n_classes: int) -> Integers:
    """Extend labels (-1: none): `n_classes` for steady runs, one more for those without a window.

    Runs of these kinds that have a label keep it. Points without a result have -1.
    """
    state = np.asarray(status)
    vote = np.where((state >= Status.DONE) & (state <= Status.NO_WINDOW), labels, -1)
    vote[(vote < 0) & (state == Status.STEADY)] = n_classes
    vote[(vote < 0) & (state == Status.NO_WINDOW)] = n_classes + 1
    return vote


def count_votes(cell_of_point: Integers, labels: Integers, n_cells: int) -> Integers:
    """Count labels per cell, shape (n_cells, largest label + 1). Negative labels are ignored."""
    valid = labels >= 0
    counts = np.zeros((n_cells, int(labels.max(initial=-1)) + 1), dtype=np.int64)
    np.add.at(counts, (cell_of_point[valid], labels[valid]), 1)
    return counts


def modal_labels(votes: Integers, sizes: Integers) -> Integers:
    """Return the most frequent class of each row of `votes` (n_cells, k), -1 for an empty row.

    Ties go to the class with the larger `sizes` (k,), then to the smaller label.
    """
    if votes.shape[1] == 0:
        return np.full(len(votes), -1, dtype=np.int64)
    leading = votes == votes.max(axis=1, keepdims=True)
    modal = np.where(leading, sizes, -1).argmax(axis=1)
    return np.where(votes.any(axis=1), modal, -1)


def modal_votes(votes: Integers, sizes: Integers) -> Integers:
    """Return the modal class of each row of `votes` (n, k + 2), whose last columns are no classes.

    The last two columns count steady runs and runs without a window. They decide only if no run
    has a class: the result is then k (steady) if more runs are steady, else k + 1 (no window). It
    is -1 for an empty row. `sizes` (k,) decides ties, see `modal_labels`.
    """
    k = len(sizes)
    modal = modal_labels(votes[:, :k], sizes)
    silent = np.where(votes[:, k] > votes[:, k + 1], k, k + 1)
    return np.where(modal >= 0, modal, np.where(votes.any(axis=1), silent, -1))


def entropy_bits(votes: Integers) -> Floats:
    """Return the entropy -sum p log2 p of each row of counts, in bits; 0 for an empty row."""
    total = votes.sum(axis=1, keepdims=True)
    share = votes / np.maximum(total, 1)
    terms = share * np.log2(share, where=share > 0.0, out=np.zeros_like(share))
    entropy: Floats = np.abs(terms.sum(axis=1))
    return entropy


def run_names(labels: Integers, status: ArrayLike, names: Sequence[str]) -> list[str | None]:
    """Name the class of every run: its class, ``steady``, ``no_window``, or None without result."""
    every: list[str | None] = [*names, STEADY, NO_WINDOW, None]
    return [every[vote] for vote in vote_labels(labels, status, len(names))]
