"""What a report shows of a sweep: read from its store, classified, counted by cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Classification, Cut, classify, has_triplet
from chimera_hpc.classify.modes import count_votes, modal_votes, vote_labels
from chimera_hpc.classify.naming import CLASSES, NO_WINDOW, STEADY
from chimera_hpc.job.class_names import naming_rule
from chimera_hpc.reduction.cells import FreeAxis, describe, free_axes
from chimera_hpc.reduction.reduction import RESULTS
from chimera_hpc.reduction.results import TRIPLET, count_points, read_results
from chimera_hpc.run.judge import other_judge
from chimera_hpc.run.rounds import Standing, judged
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.ledger import LedgerScan
from chimera_hpc.store.store import Store

Integers = NDArray[np.int64]

JUDGE = "judge"
"""Stands for a cut: the classes by which the cells of a sweep with [decide] are decided."""
MOST_CLUSTERS = 8
"""The movable cut goes from 2 to this many clusters, and to those that the job asks for."""

_MOST_VOTES = 500_000
"""Numbers of votes that the page holds, about."""


@dataclass(frozen=True)
class CellVotes:
    """What the runs of each cell say in one cut; n_cells cells, k classes."""

    names: tuple[str, ...]
    """k classes, then steady and no_window."""
    votes: Integers
    """(n_cells, k + 2)"""
    modal: Integers
    """(n_cells,) position in `names`, -1 where a cell has no result yet."""


@dataclass(frozen=True)
class Content:
    """A sweep as far as it is done; n points in n_cells cells."""

    folder: Path
    store: Store
    scan: LedgerScan
    triplets: NDArray[np.float64]
    """(n, 3) V_theta, V_a, V_Omega; NaN where a point has none."""
    r_squared: NDArray[np.float64]
    """(n,) median R^2 of the fits of each point; NaN where a point has none."""
    classification: Classification
    results: Mapping[str, Any]
    """results.json, as far as it belongs to this sweep; empty when there is none yet."""

    @classmethod
    def read(cls, folder: Path, largest_tree: int | None = None) -> Self:
        """Read the sweep in a folder.

        The tree is that of the last reduction where that is in step with the ledger; otherwise it
        is grown again, over at most `largest_tree` points (`classify`'s own limit by default).

        Raises BadInput: no store in the folder.
        Raises DamagedChunk: A chunk of results that the ledger vouches for is missing or damaged.
        """
        store = Store.open(folder / STORE_NAME)
        scan, scalars = store.scan(), store.scalars()
        triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
        made = _classified(store, triplets, scan.columns["status"], largest_tree)
        r_squared = store.quality()["r_squared"]
        return cls(folder, store, scan, triplets, r_squared, made, _results(folder, store))

    @property
    def status(self) -> Integers:
        """`Status` of each point."""
        return self.scan.columns["status"]

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of points by outcome, as in results.json."""
        return count_points(self.status)

    @cached_property
    def _cells(self) -> tuple[Integers, Mapping[str, NDArray[Any]]]:
        return self.store.points.cells()

    @property
    def cell(self) -> Integers:
        """Cell of each point."""
        return self._cells[0]

    @property
    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Parameters of the cells, (n_cells,) each."""
        return self._cells[1]

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.columns["delta"])

    @cached_property
    def axes(self) -> list[FreeAxis]:
        """What varies between cells."""
        names = [name for name in self.store.points.axes if name != "seed"]
        return free_axes(self.columns, names)

    @cached_property
    def standing(self) -> Standing | None:
        """How far the cells of a sweep with [decide] are decided; None without one.

        Also None while the judge is not there: before the end of the first round, or without the
        atlas that judges.
        """
        sweep, n_first = self.store.sweep, len(self.store.sweeps[0].points())
        if sweep.decide is None or (self.status[:n_first] == Status.NEVER).any():
            return None
        try:
            atlas = other_judge(self.store)
        except BadInput:
            return None
        return judged(sweep, self.store.points, self.triplets, self.status, n_first, atlas)

    @cached_property
    def opening(self) -> Cut:
        """The classes that the page opens with: those by which cells are decided, or the tree's."""
        return self.cuts[self.first_cut] if self.standing is None else self.standing.cut

    @cached_property
    def cuts(self) -> dict[int, Cut]:
        """Cuts by their number of clusters, rising: the first that the job names, and others.

        As many others as there is room for the votes of all cells; at least one cut, which may be
        empty.
        """
        made = self.classification.cuts
        real = {k: cut for k, cut in made.items() if len(cut.names) == k}
        if not real:
            return dict(list(made.items())[:1])
        chosen, room = {self.first_cut}, _MOST_VOTES // max(1, self.n_cells)
        for k in sorted(real):
            if sum(chosen) + k <= room:
                chosen.add(k)
        return {k: real[k] for k in sorted(chosen)}

    @cached_property
    def named_cuts(self) -> dict[str, Cut]:
        """The cuts, and the classes of the judge as `JUDGE`, by their names on the page."""
        judge = {} if self.standing is None else {JUDGE: self.standing.cut}
        return {**judge, **{str(k): cut for k, cut in self.cuts.items()}}

    @cached_property
    def first_cut(self) -> int:
        """Number of clusters of the cut that is shown first: the first that the job names."""
        spec, made = self.store.sweep.reduction, self.classification.cuts
        asked = [*spec.cuts, *(k for k, cut in made.items() if cut.depth == spec.depth), *made]
        return next((k for k in asked if len(made[k].names) == k), next(iter(made)))

    def count(self, *codes: Status) -> Integers:
        """Count in each cell the points with one of these outcomes."""
        chosen = self.cell[np.isin(self.status, [int(code) for code in codes])]
        return np.bincount(chosen, minlength=self.n_cells).astype(np.int64)

    def votes(self, cut: Cut) -> CellVotes:
        """Count votes as `reduce.modes.modal_classes` does, all cells at once."""
        names = (*cut.names, STEADY, NO_WINDOW)
        labels = vote_labels(cut.labels, self.status, len(cut.names))
        votes = count_votes(self.cell, labels, self.n_cells)
        votes = np.pad(votes, ((0, 0), (0, len(names) - votes.shape[1])))
        return CellVotes(names, votes, modal_votes(votes, cut.sizes))

    def cell_name(self, i: int) -> str:
        """Return where a cell lies: ``P = 9, Q = 3``."""
        return describe({name: column[i] for name, column in self.columns.items()}, self.axes)

    def point_words(self, i: int) -> str:
        """Return a point as commands take it: ``P=9 Q=3 seed=7``."""
        row = self.store.points.row(i)
        return " ".join(f"{name}={row[name]}" for name in self.store.points.axes)


def _classified(
    store: Store, triplets: NDArray[np.float64], status: Integers, largest_tree: int | None
) -> Classification:
    spec = store.sweep.reduction
    return classify(
        triplets,
        status,
        linkage=spec.linkage,
        classifier=spec.classifier,
        # The first names the classes: that of the job, as in its reduction.
        cuts=list(dict.fromkeys([*spec.cuts, len(CLASSES), *range(2, MOST_CLUSTERS + 1)])),
        depth=spec.depth,
        names=naming_rule(store.sweep),
        largest_tree=largest_tree,
        known=_known_tree(store, has_triplet(triplets, status)),
    )


def _known_tree(
    store: Store, clustered: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """Return linkage and members of the stored reduction, if it clustered the same points."""
    try:
        stored = store.reduction()
    except BadInput:
        return None
    cuts = stored.attributes.get("cuts") or [None]
    labels = stored.arrays.get(f"labels_{cuts[0]}")
    same_method = stored.attributes.get("method") == store.sweep.reduction.linkage
    if labels is None or len(labels) != len(clustered) or not same_method:
        return None
    if not np.array_equal(labels >= 0, clustered):
        return None
    return stored.arrays["linkage"], stored.arrays["members"]


def _results(folder: Path, store: Store) -> dict[str, Any]:
    try:
        results = read_results(folder / RESULTS)
    except BadInput:
        return {}
    return results if results["sweep"] == store.sweep.name else {}
