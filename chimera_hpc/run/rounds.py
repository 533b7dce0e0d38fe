"""The rounds of a sweep with [decide]: how far its cells are decided, and what comes next.

The next round is a pure function of the contents of the store (ledger, features, specs) and of the
atlas, if one judges. A run that was killed, or another process, therefore chooses the same points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.boundaries import new_cells
from chimera_hpc.classify.classification import TRIPLET, Cut, has_triplet
from chimera_hpc.classify.deciding import SILENT, Decisions, decisions, expected_runs
from chimera_hpc.classify.modes import NO_WINDOW, STEADY, count_votes, vote_labels
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.added import SEEDS
from chimera_hpc.job.axes import Same
from chimera_hpc.job.decide import Decide
from chimera_hpc.job.points import dependency_order, point_keys
from chimera_hpc.models.parameters import Column
from chimera_hpc.run.judge import frozen_judge, other_judge
from chimera_hpc.store.store import Store


@dataclass(frozen=True)
class Standing:
    """How far the cells of a store are decided; arrays (n_cells,) but for the labels."""

    decide: Decide
    axes: tuple[str, ...]
    """Names of the axes without the seed."""
    independent: tuple[str, ...]
    """Those that do not follow another axis."""
    cells: Mapping[str, Column]
    n_grid: int
    """Number of cells of the grid; the others are refined ones, or those of a merged store."""
    runs: NDArray[np.int64]
    judge: Atlas
    """What gives the runs their classes: that of the first round's tree, or another sweep's."""
    labels: NDArray[np.int64]
    """(n_points,) class of each run by the judge, -1 where it has none."""
    votes: NDArray[np.int64]
    """(n_cells, classes + 2)"""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of `votes`."""
        return (*self.judge.names, STEADY, NO_WINDOW)

    @property
    def cut(self) -> Cut:
        """The judge's classes of all runs as a cut, which belongs to no tree of these runs."""
        names, unknown = self.judge.names, np.full((len(self.judge.names), 3), np.nan)
        return Cut(self.labels, names, names, unknown, self.judge.sizes, np.nan)

    @cached_property
    def found(self) -> Decisions:
        return decisions(self.votes, self.judge.sizes, self.decide.confidence)

    @cached_property
    def open(self) -> NDArray[np.bool_]:
        """Cells that get further runs. A cell whose runs have all failed gets none."""
        possible = self.votes.any(axis=1) & (self.runs < self.decide.most)
        return np.asarray(possible & ~self.found.decided)

    @property
    def classes(self) -> NDArray[np.int64]:
        """Decided class of each cell, -1 where none is."""
        return np.where(self.found.decided, self.found.leader, -1)

    def expected_runs(self) -> float:
        """Return how many further runs the cells are expected to take; see `expected_runs`."""
        decide = self.decide
        votes = self.votes[self.open]
        return expected_runs(votes, self.judge.sizes, decide.confidence, decide.batch, decide.most)


def standing(store: Store) -> Standing | None:
    """Return how far the cells of a store are decided; None for a job without [decide]."""
    if store.sweep.decide is None:
        return None
    scalars = store.scalars()
    triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
    n_first = len(store.sweeps[0].points())
    status = store.ledger()["status"]
    return judged(store.sweep, store.points, triplets, status, n_first, other_judge(store))


def judged(
    sweep: Sweep,
    points: Points,
    triplets: NDArray[np.float64],
    status: NDArray[np.int64],
    n_first: int,
    atlas: Atlas | None = None,
) -> Standing:
    """Judge runs by an atlas, or by the tree over the first `n_first` of them.

    triplets: (n_points, 3); NaN where a run has none.
    """
    assert sweep.decide is not None
    judge = atlas or frozen_judge(sweep, triplets, status, n_first)
    labels = np.where(has_triplet(triplets, status), judge.classify(triplets).label, -1)
    cell, columns = points.cells()
    votes = vote_labels(labels, status, len(judge.names))
    axes = tuple(name for name in points.axes if name != "seed")
    n_cells = int(cell.max(initial=-1)) + 1
    table = count_votes(cell, votes, n_cells)
    missing = len(judge.names) + SILENT - table.shape[1]
    return Standing(
        decide=sweep.decide,
        axes=axes,
        independent=tuple(n for n in axes if not isinstance(sweep.axes[n], Same)),
        cells=columns,
        n_grid=grid_cells(sweep),
        runs=np.bincount(cell, minlength=n_cells),
        judge=judge,
        labels=labels,
        votes=np.pad(table, ((0, 0), (0, missing))),
    )


def grid_cells(sweep: Sweep) -> int:
    """Return the number of cells of the grid of a sweep with [decide], without those added."""
    assert sweep.decide is not None
    return len(sweep.model_copy(update={"added": None}).points()) // sweep.decide.first


def next_sweep(store: Store) -> Sweep | None:
    """Return the sweep with the points of the next round; None when there is nothing to decide.

    Every point of the store must have been run.
    """
    now = standing(store)
    if now is None:
        return None
    decide = now.decide
    batch = np.where(now.open, np.minimum(decide.batch, decide.most - now.runs), 0)
    made = new_cells(now.cells, now.classes, now.open, decide.refine, now.independent)
    if not made and not batch.any():
        return None
    made = _with_followers(made, store.sweep, now.axes)
    added = _added(now, now.runs + batch, _in_grid(store), made)
    data = {**store.sweep.to_dict(), "added": added}
    return Sweep.from_dict(data, str(store.path), store.sweep.origin)


def _in_grid(store: Store) -> NDArray[np.bool_]:
    """Return (n_cells,) which cells are in the grid of the last spec.

    Others are refined ones, or those of another store that was merged.
    """
    cell, points = store.points.cells()[0], store.points
    first = points[np.unique(cell, return_index=True)[1]]
    grid = store.sweep.model_copy(update={"added": None}).points()
    return np.asarray(np.isin(point_keys(first), point_keys(grid, first)))


def _added(
    now: Standing,
    seeds: NDArray[np.int64],
    in_grid: NDArray[np.bool_],
    made: Sequence[Mapping[str, int | float]],
) -> dict[str, list[int | float]]:
    """Return the table [added]: the cells with other seeds than the grid has, then new ones."""
    first = now.decide.first
    kept = np.flatnonzero((seeds != first) | ~in_grid)
    table = {name: now.cells[name][kept].tolist() for name in now.axes}
    for name in now.axes:
        table[name] += [cell[name] for cell in made]
    return {**table, SEEDS: [*seeds[kept].tolist(), *[first] * len(made)]}


def _with_followers(
    cells: Sequence[Mapping[str, int | float]], sweep: Sweep, axes: Sequence[str]
) -> list[dict[str, int | float]]:
    """Add the values of the axes that follow others."""
    made = [dict(cell) for cell in cells]
    for name in dependency_order(sweep.axes):
        axis = sweep.axes[name]
        if isinstance(axis, Same):
            for cell in made:
                cell[name] = cell[axis.name]
    return [{name: cell[name] for name in axes} for cell in made]


def next_round(store: Store) -> Store | None:
    """Extend a store by the points of its next round and return it; None when there is none.

    If another process has already extended it, that extension is returned.
    """
    present = Store.open(store.path, store.sweep.origin)
    if present.n_points > store.n_points:
        return present
    sweep = next_sweep(present)
    if sweep is None:
        return None
    try:
        return present.extend(sweep)
    except BadInput:
        # Another process may have gone further meanwhile.
        found = Store.open(store.path, store.sweep.origin)
        if found.n_points == present.n_points:
            raise
        return found
