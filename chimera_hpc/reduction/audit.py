"""The error bar of a phase diagram: how reliable the labels of a sweep's runs are.

A sample of the points is computed again in three ways (see `audit_runs`): at 100 times tighter
tolerances, from an initial state moved by 1e-13, and over a run five times as long. All runs are
labelled by the frozen classes of the last reduction. Trajectories near the border of two classes
are chaotic, so the changes at tighter tolerances are compared with those of the moved initial
state, the control. The seeds of every cell are also resampled, to find how often its modal class
stays the same.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import write_atomically
from chimera_hpc.base.status import Status
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.classification import has_triplet
from chimera_hpc.classify.modes import NO_WINDOW, STEADY, count_votes, modal_votes, vote_labels
from chimera_hpc.classify.resampling import DRAWS, FIRM, compare_labels, kept_shares, spread_sample
from chimera_hpc.reduction.audit_runs import WAYS, Runs, compute_again, described, runs_of
from chimera_hpc.reduction.cells import free_axes
from chimera_hpc.reduction.conventions import OWN, conventions, seen_under, stored_reduction
from chimera_hpc.reduction.results import count_points, json_safe, read_results, to_json
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.reduction import StoredReduction
from chimera_hpc.store.store import Store

Integers = NDArray[np.int64]
Labels = list[str | None]

RULE = (
    "points with a result in the random order of numpy's default_rng(seed), "
    "none a second of its cell before every cell has one"
)
_RESULTS = "results.json"
_RESAMPLING = 1
"""Second number of the random stream that resamples seeds."""


@dataclass(frozen=True)
class Sample:
    """Which points are computed again; `share` counts unless there are `points`."""

    share: float = 0.05
    points: int | None = None
    seed: int = 0

    def size(self, usable: int) -> int:
        """Return how many of so many points: at least one."""
        asked = round(self.share * usable) if self.points is None else self.points
        return min(usable, max(1, asked))


@dataclass(frozen=True)
class Labeller:
    """The frozen classes that label runs."""

    name: str
    """In words."""
    atlas: Atlas | None
    """None: the label says whether a run ends inside the ball in which it started."""

    @classmethod
    def of(cls, store: Store, own: Atlas, others: Mapping[str, Atlas]) -> Labeller:
        """Return the judge of a sweep.

        The first atlas that the job names, else the sweep's own; none where it maps a basin.
        """
        if "basin" in store.sweep.reduction.analyses:
            if "distance" not in store.sweep.measures.panel:
                raise BadInput("measures.panel: the basin of a sweep needs the measure distance")
            return cls("inside or outside the ball of initial states", None)
        for name, atlas in others.items():
            return cls(f"the classes of {name}", atlas)
        return cls("the classes of this sweep", own)

    def labels(self, runs: Runs, radius: NDArray[np.float64]) -> Labels:
        """Label n runs; None where one has no result. `radius` (n,) is that of the ball."""
        if self.atlas is None:
            names = np.where(runs.distance <= radius, "inside", "outside").tolist()
        else:
            names = self.atlas.classify(runs.triplets).name
        known = has_triplet(runs.triplets, runs.status)
        done = [self.atlas is None or has for has in known.tolist()]
        return [
            (name if ok else Status(code).name.lower()) if Status(code).is_result else None
            for name, ok, code in zip(names, done, runs.status.tolist(), strict=True)
        ]


@dataclass(frozen=True, eq=False)
class Basis:
    """The basis of an audit: the points of a sweep with their labels and classes."""

    store: Store
    ledger: Mapping[str, Integers]
    cuts: Mapping[int, tuple[Integers, Sequence[str]]]
    """For each cut the label of each point (-1: none), and the names of its classes."""
    judge: Labeller
    labels: Labels

    @property
    def key(self) -> str:
        """Digest: if it has changed, an earlier audit is no longer valid."""
        state = blake2b(digest_size=16)
        words = [list(self.labels), [[k, list(names)] for k, (_, names) in self.cuts.items()]]
        state.update(json.dumps([[s.digest for s in self.store.sweeps], *words]).encode())
        numbers = (self.ledger["status"], self.ledger["digest"])
        for column in (*numbers, *(labels for labels, _ in self.cuts.values())):
            state.update(np.ascontiguousarray(column, dtype=np.int64).tobytes())
        return state.hexdigest()


def audit_sweep(
    folder: str | Path,
    sample: Sample,
    *,
    workers: int = 1,
    ways: Sequence[str] = WAYS,
    on_piece: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Audit a reduced sweep, and write what was found into results.json under ``audit``.

    The store is read only. After a kill at any moment, results.json is complete, in its old or its
    new state. Labels under the other conventions of the sweep's panel are compared too, for the
    same runs.

    folder: a sweep's folder, the one that holds store.zarr.
    workers: worker processes on this machine; below 2 this process computes. The result is the
        same.
    ways: of `audit_runs.WAYS`.
    on_piece: called with the numbers of runs done and in all, as they are done.

    Returns what results.json holds for the sweep's own convention; docs/audit.md has the keys.

    Raises BadInput: no store, not reduced since its last points were computed, or no point with a
    result.
    Raises DamagedChunk: A chunk of results that the ledger vouches for is missing or damaged.
    """
    folder = Path(folder)
    named = conventions(Store.open(folder / STORE_NAME).sweep)
    before = {name: read_results(folder / name / _RESULTS) for name in named}
    standing = {name: _standing(folder, name, before[name]) for name in named}
    basis = standing[OWN][0]
    usable = np.flatnonzero([label is not None for label in basis.labels])
    if not len(usable):
        raise BadInput(f"{folder}: no point has a result yet; there is nothing to audit")
    cell, _ = basis.store.points.cells()
    chosen = spread_sample(cell, usable, sample.size(len(usable)), sample.seed)
    done = 0

    def tick(runs: int) -> None:
        nonlocal done
        done += runs
        on_piece(done, len(ways) * len(chosen))

    again = compute_again(basis.store.path, chosen, ways, workers, tick)
    entries: dict[str, dict[str, Any]] = {}
    for name, (basis, stored) in standing.items():
        runs = {way: Runs.of(basis.store.sweep, made, name) for way, made in again.items()}
        entries[name] = json_safe(
            {
                "key": basis.key,
                "seed": sample.seed,
                "rule": RULE,
                "labels": basis.judge.name,
                "points": len(chosen),
                "of": len(usable),
                "total": basis.store.n_points,
                "classes": Counter(basis.labels[i] for i in chosen),
                **_compared(basis, stored, chosen, runs),
                "bootstrap": _bootstrap(basis, sample.seed),
            }
        )
        _write(folder / name, before[name], entries[name])
    return entries[OWN]


def kept_audit(folder: Path, basis: Callable[[], Basis]) -> tuple[dict[str, Any], str]:
    """Return ``{"audit": ...}`` of the results.json there, if it stands, and a line if it does not.

    `basis` is asked for only where there is one.
    """
    try:
        audit = read_results(folder / _RESULTS).get("audit")
    except BadInput:
        return {}, ""
    if audit is None:
        return {}, ""
    if audit["key"] == basis().key:
        return {"audit": audit}, ""
    return {}, "the audit was of other points or classes and is dropped; `audit` makes it again"


def _standing(folder: Path, convention: str, results: Mapping[str, Any]) -> tuple[Basis, Runs]:
    store = Store.open(folder / STORE_NAME)
    ledger, stored = store.ledger(), stored_reduction(folder, convention)
    scalars, status = seen_under(convention, store.sweep, store.scalars(), ledger["status"])
    ledger = {**ledger, "status": status}
    if results["points"] != count_points(ledger["status"]):
        raise BadInput(f"{folder}: points were computed since the last reduction; `reduce` first")
    cuts = {
        k: (stored.arrays[f"labels_{k}"], stored.attributes[f"names_{k}"][:-2])
        for k in stored.attributes["cuts"]
    }
    own = Atlas.from_arrays(stored.arrays, stored.attributes)
    judge = Labeller.of(store, own, _other_atlas(stored))
    runs = runs_of(ledger["status"], scalars, ledger["steps"])
    return basis_of(store, ledger, runs, cuts, judge), runs


def basis_of(
    store: Store,
    ledger: Mapping[str, Integers],
    runs: Runs,
    cuts: Mapping[int, tuple[Integers, Sequence[str]]],
    judge: Labeller,
) -> Basis:
    """Label all points of a store."""
    radius = store.points.columns["delta"].astype(np.float64)
    return Basis(store, ledger, cuts, judge, judge.labels(runs, radius))


def _other_atlas(stored: StoredReduction) -> dict[str, Atlas]:
    first = stored.attributes.get("judge_0")
    if first is None:
        return {}
    start = "judge_0_"
    arrays = {
        name.removeprefix(start): values
        for name, values in stored.arrays.items()
        if name.startswith(start)
    }
    return {first["sweep"]: Atlas.from_arrays(arrays, first)}


def _compared(
    basis: Basis, stored: Runs, chosen: Integers, again: Mapping[str, Runs]
) -> dict[str, Any]:
    """Return how the labels of the chosen points compare with those of each way."""
    radius = basis.store.points.columns["delta"][chosen].astype(np.float64)
    before = [str(basis.labels[i]) for i in chosen]
    after = {way: basis.judge.labels(runs, radius) for way, runs in again.items()}
    return {
        "ways": {
            way: {
                "what": described(basis.store.sweep.integrator, way),
                "steps": _ratio(runs.steps, stored.steps[chosen]),
                "failed": _failures(runs.status),
                **compare_labels(before, after[way])._asdict(),
            }
            for way, runs in again.items()
        },
        "changed": _changed_points(basis, chosen, before, after),
    }


def _ratio(steps: Integers, before: Integers) -> float:
    return float(steps.sum() / max(1, before.sum()))


def _failures(status: Integers) -> dict[str, int]:
    return dict(Counter(Status(c).name.lower() for c in status.tolist() if not Status(c).is_result))


def _changed_points(
    basis: Basis, chosen: Integers, before: Sequence[str], after: Mapping[str, Labels]
) -> list[dict[str, Any]]:
    """Describe each point that has another label, or none, in one of the ways."""
    points = basis.store.points
    free = [axis for axis in points.axes if axis != "seed"]
    found = []
    for k, (i, label) in enumerate(zip(chosen.tolist(), before, strict=True)):
        labels = {way: names[k] for way, names in after.items()}
        if any(name != label for name in labels.values()):
            row = points.row(i)
            place = {name: row[name] for name in (*free, "seed")}
            found.append({"point": i, "place": place, "label": label, **labels})
    return found


def _bootstrap(basis: Basis, seed: int) -> dict[str, Any]:
    """Resample the seeds of every cell: by the labels, and by the classes of each cut."""
    cell, columns = basis.store.points.cells()
    status = basis.ledger["status"]
    names = sorted({x for x in basis.labels if x is not None} - {STEADY, NO_WINDOW})
    every: list[str | None] = [*names, STEADY, NO_WINDOW]
    codes = np.array([every.index(x) if x in every else -1 for x in basis.labels], dtype=np.int64)
    votes, kept = _resampled(cell, codes, len(names), seed)
    modal = modal_votes(votes, _sizes(codes, len(names)))
    axes = free_axes(columns, [name for name in basis.store.points.axes if name != "seed"])
    loose = [i for i in np.argsort(kept, kind="stable").tolist() if kept[i] < FIRM]
    known = kept[np.isfinite(kept)]
    by_cut = {
        k: _resampled(cell, vote_labels(labels, status, len(words)), len(words), seed)[1]
        for k, (labels, words) in basis.cuts.items()
    }
    return {
        "draws": DRAWS,
        "cells": len(known),
        "single": int(np.count_nonzero(votes.sum(axis=1) == 1)),
        "mean": known.mean() if len(known) else None,
        "loose": [
            {
                "place": {name: axis.values[i].item() for axis in axes for name in axis.names},
                "class": every[modal[i]],
                "kept": kept[i],
            }
            for i in loose
        ],
        "kept": {str(k): values for k, values in by_cut.items()},
    }


def _resampled(
    cell: Integers, codes: Integers, n_classes: int, seed: int
) -> tuple[Integers, NDArray[np.float64]]:
    """Return the votes (n_cells, n_classes + 2) and how often each cell keeps its modal class."""
    votes = count_votes(cell, codes, int(cell.max()) + 1)
    votes = np.pad(votes, ((0, 0), (0, n_classes + 2 - votes.shape[1])))
    rng = np.random.default_rng([seed, _RESAMPLING])
    return votes, kept_shares(votes, _sizes(codes, n_classes), rng)


def _sizes(codes: Integers, n_classes: int) -> Integers:
    inside = codes[(codes >= 0) & (codes < n_classes)]
    return np.bincount(inside, minlength=n_classes).astype(np.int64)


def _write(folder: Path, before: Mapping[str, Any], entry: Mapping[str, Any]) -> None:
    """Add the audit to results.json, unless the sweep was reduced otherwise meanwhile."""
    path = folder / _RESULTS
    present = read_results(path)
    if any(present[key] != before[key] for key in ("points", "cuts")):
        raise BadInput(f"{path}: reduced again while the audit went on; run `audit` again")
    write_atomically(path, to_json({**present, "audit": entry}).encode())
