"""What [decide] saves on the paper's plane, and how often it is right.

    PYTHONPATH=jobs/paper python -m scoreboard.deciding results/paper/plane
    PYTHONPATH=jobs/paper python -m scoreboard.deciding results/paper/plane --batch 5 --most 20

The stored plane is the truth. Each resampling shuffles the 20 seeds of every cell and lets [decide]
take them in that order: the frozen judge is the tree over the first of them. The truth is the modal
class by the tree over all runs, where 20 votes decide it. Then the votes of the plane serve as
shares, from which up to 100 seeds per cell are drawn, without a judge: cells near a tie are in
these, exact ties are not.

A cell that is decided as steady, for no run of it oscillates, is right here if most of its runs
are. By the paper's convention its class is that of the runs that do, be they one of 20: how many of
the decided cells are of this kind is printed, too.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.classification import TRIPLET, Cut, classify
from chimera_hpc.classify.deciding import SILENT, Decisions, decisions
from chimera_hpc.classify.modes import count_votes, vote_labels
from chimera_hpc.job import Sweep
from chimera_hpc.run.rounds import judged
from chimera_hpc.store.store import Store

Integers = NDArray[np.int64]


class Plane:
    """The runs of a stored sweep whose cells have equally many seeds."""

    def __init__(self, folder: Path, **decide: float) -> None:
        self.store = Store.open(folder / "store.zarr")
        scalars = self.store.scalars()
        self.triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
        self.status = self.store.ledger()["status"]
        self.cell = self.store.points.cells()[0]
        self.n_cells = int(self.cell.max()) + 1
        self.rows = np.argsort(self.cell, kind="stable").reshape(self.n_cells, -1)
        spec = self.store.sweep.to_dict()
        grid = {name: axis for name, axis in spec["grid"].items() if name != "seeds"}
        most = min(int(decide.get("most", 20)), self.rows.shape[1])
        table = {**decide, "most": most}
        self.sweep = Sweep.from_dict({**spec, "grid": grid, "decide": table})
        assert self.sweep.decide is not None
        self.decide = self.sweep.decide
        made = classify(self.triplets, self.status, cuts=self.sweep.reduction.cuts)
        self.cut: Cut = made.cuts[self.sweep.reduction.cuts[0]]
        labels = vote_labels(self.cut.labels, self.status, len(self.cut.names))
        votes = count_votes(self.cell, labels, self.n_cells)
        missing = len(self.cut.names) + SILENT - votes.shape[1]
        self.votes = np.pad(votes, ((0, 0), (0, missing)))
        self.most_votes = self.votes.argmax(axis=1)
        self.truth = decisions(self.votes, self.cut.sizes, self.decide.confidence)

    def right(self, found: Decisions) -> NDArray[np.bool_]:
        """Return which cells have the true class, or are steady and most of their runs are."""
        silent = found.leader >= len(self.cut.names)
        hits: NDArray[np.bool_] = found.leader == np.where(
            silent, self.most_votes, self.truth.leader
        )
        return hits

    def resampled(self, rng: np.random.Generator) -> tuple[float, ...]:
        """Return the share of the runs, decided cells, and which share of these is right.

        Of the decided cells that the truth decides too, the same by the paper's convention, and of
        all decided cells.
        """
        order = rng.permuted(self.rows, axis=1)
        n = np.full(self.n_cells, self.decide.first)
        while True:
            taken = np.arange(order.shape[1]) < n[:, None]
            first = order[:, : self.decide.first]
            rest = order[:, self.decide.first :][taken[:, self.decide.first :]]
            rows = np.concatenate([first.ravel(), rest])
            points, n_first = self.store.points[rows], first.size
            now = judged(self.sweep, points, self.triplets[rows], self.status[rows], n_first)
            if not now.open.any():
                break
            n[now.open] = np.minimum(n[now.open] + self.decide.batch, self.decide.most)
        assert now.judge.names == self.cut.names
        decided = now.found.decided
        right, same = self.right(now.found), now.found.leader == self.truth.leader
        both = decided & self.truth.decided
        shares = (right[both].mean(), same[both].mean(), right[decided].mean())
        return n.sum() / order.size, int(decided.sum()), *shares

    def redrawn(self, rng: np.random.Generator, most: int = 100) -> tuple[float, float]:
        """Return the share of decided cells that are right, of seeds drawn from the votes.

        Then the same by the paper's convention.
        """
        decide = self.decide
        shares = self.votes / self.votes.sum(axis=1, keepdims=True)
        drawn = rng.multinomial(decide.first, shares)
        while True:
            found = decisions(drawn, self.cut.sizes, decide.confidence)
            open_ = ~found.decided & (drawn.sum(axis=1) < most)
            if not open_.any():
                break
            drawn[open_] += rng.multinomial(decide.batch, shares[open_])
        classes = np.sort(self.votes[:, :-SILENT], axis=1)
        untied = (classes[:, -1] > classes[:, -2]) | (classes[:, -1] == 0)
        chosen = found.decided & untied
        same = found.leader == self.truth.leader
        return float(self.right(found)[chosen].mean()), float(same[chosen].mean())


def main() -> None:
    """Print what [decide] takes of the plane, and how often it is right."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("plane", type=Path)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--first", type=int, default=5)
    parser.add_argument("--batch", type=int, default=2)
    parser.add_argument("--most", type=int, default=8)
    args = parser.parse_args()
    plane = Plane(args.plane, first=args.first, batch=args.batch, most=args.most)
    rng = np.random.default_rng(0)
    found = np.array([plane.resampled(rng) for _ in range(args.draws)])
    runs, n_decided, right, same, right_of_all = found.T
    print(f"{int(plane.truth.decided.sum())} of {plane.n_cells} cells are decided by the plane")
    print(f"runs: {runs.mean():.1%} of the plane's, at most {runs.max():.1%}")
    print(f"decided: {n_decided.mean():.0f} cells, at least {n_decided.min():.0f}")
    _tell("right, of those that the plane decides", right, plane.decide.confidence)
    _tell("  by the paper's convention", same, plane.decide.confidence)
    _tell("right, of all decided", right_of_all, plane.decide.confidence)
    again = np.array([plane.redrawn(rng) for _ in range(args.draws)])
    _tell("redrawn with up to 100 seeds, right", again[:, 0], plane.decide.confidence)
    _tell("  by the paper's convention", again[:, 1], plane.decide.confidence)


def _tell(what: str, shares: NDArray[np.float64], confidence: float) -> None:
    holds = int((shares >= confidence).sum())
    print(
        f"{what}: {shares.mean():.2%}, at least {shares.min():.2%}; "
        f"{confidence:.0%} or more in {holds} of {len(shares)}"
    )


if __name__ == "__main__":
    main()
