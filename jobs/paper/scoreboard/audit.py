"""How firm the labels are: a random share of all points, run again in three ways.

At 100 times tighter tolerance; with the initial state moved by 1e-13 at the old tolerance (the
control: trajectories are chaotic, so that labels near borders flip without any fault of the
integrator); and to t = 5000, analysed over a stretch as long as before (are chimeras transients?).
Every run is judged by its sweep's own atlas, or by the first one that its job names. Then the votes
of each cell are resampled over the seeds: how often the modal class comes out the same. What is
found is one entry a job, with its cells in `cells`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.robustness import wilson_interval
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.tables import Keep
from chimera_hpc.reduction.atlases import load_atlas, sibling
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.store import Store
from scoreboard.cells import audit_cells, axes_of, change
from scoreboard.plan import JOBS

_SHORT = ("networks", "networks-2", "synthetic", "stability")
"""Jobs without classes."""
_BASINS = ("basin", "basin-200")
_TIGHTER, _MOVED, _LATE = 100.0, 1e-13, 5000.0
_PIECE = 8
WAYS = ("tighter", "moved", "late")

Say = Callable[[str], None]
Array = NDArray[np.float64]


def audit_jobs(
    folder: Path, names: Sequence[str], share: float, workers: int, say: Say
) -> dict[str, Any]:
    """Audit jobs that lie beside each other; one entry a job."""
    found = {}
    context = get_context("spawn")
    with ProcessPoolExecutor(max_workers=max(workers, 1), mp_context=context) as pool:
        for name in names:
            if name in _SHORT or not (folder / name / STORE_NAME).is_dir():
                continue
            rng = np.random.default_rng([20, JOBS.index(name)])
            found[name] = _audit(folder / name, name, share, pool, rng)
            say(f"audit {name}: {_line(found[name])}")
    return found


def variants(sweep: Sweep, points: Points, which: Sequence[str]) -> dict[str, tuple[Sweep, Points]]:
    """Return the sweep and the points that each way of running again stands for."""
    spec, features = sweep.integrator, sweep.features
    keep = Keep(series="none")
    tight = spec.model_copy(update={"rtol": spec.rtol / _TIGHTER, "atol": spec.atol / _TIGHTER})
    late = spec.model_copy(update={"t_end": _LATE, "time_out": 10.0 * spec.time_out})
    start = _LATE - (spec.t_end - features.start)
    late_features = features.model_copy(update={"start": start})
    radius: Array = points.columns["delta"].astype(np.float64) + _MOVED
    moved = Points(dict(points.columns) | {"delta": radius}, points.axes)
    made = {
        "tighter": (sweep.model_copy(update={"integrator": tight, "keep": keep}), points),
        # The initial state is centre + delta * U[-1, 1], so this moves it by at most 1e-13.
        "moved": (sweep.model_copy(update={"keep": keep}), moved),
        "late": (
            sweep.model_copy(update={"integrator": late, "features": late_features, "keep": keep}),
            points,
        ),
    }
    return {way: made[way] for way in which}


def _audit(
    folder: Path, name: str, share: float, pool: ProcessPoolExecutor, rng: np.random.Generator
) -> dict[str, Any]:
    store = Store.open(folder / STORE_NAME)
    status, scalars = store.ledger()["status"], store.scalars()
    usable = np.flatnonzero(np.isin(status, [code for code in Status if code.is_result]))
    size = min(len(usable), max(1, round(share * store.n_points)))
    chosen = np.sort(rng.choice(len(usable), size, replace=False))
    basin = name in _BASINS
    judge = None if basin else _judge(folder, store)
    points = store.points[usable]
    radius: Array = points.columns["delta"].astype(np.float64)
    triplets = np.stack([scalars[key][usable] for key in TRIPLET], axis=1)
    labels = labels_of(judge, status[usable], triplets, scalars["distance"][usable], radius)
    before = [labels[i] for i in chosen]
    entry: dict[str, Any] = {
        "points": size,
        "of": store.n_points,
        "classes": dict(Counter(before)),
        "axes": [{"name": axis.names[0], "symbol": axis.symbol} for axis in axes_of(points)],
    }
    again: dict[str, list[str]] = {}
    for way in WAYS[:2] if basin else WAYS:
        pieces = [chosen[i : i + _PIECE] for i in range(0, size, _PIECE)]
        made = list(pool.map(_again, [(store.sweep, points[p], way) for p in pieces]))
        state, late, ends = (np.concatenate([m[k] for m in made]) for k in range(3))
        again[way] = labels_of(judge, state, late, ends, radius[chosen])
        entry[way] = compare(before, again[way])
    entry["cells"] = audit_cells(points, labels, chosen, again, rng, every=not basin)
    entry["bootstrap"] = _summary(entry["cells"])
    return entry


def _judge(folder: Path, store: Store) -> Atlas:
    named = store.sweep.reduction.atlas
    return load_atlas(sibling(folder, named[0]) if named else folder)


def _again(task: tuple[Sweep, Points, str]) -> tuple[NDArray[np.int64], Array, Array]:
    """Run points again one way: status, triplets and final distances."""
    from chimera_hpc.run.block import run_block
    from chimera_hpc.store.schema import scalar_labels

    sweep, points, way = task
    sweep, points = variants(sweep, points, [way])[way]
    result = run_block(sweep, points)
    place = {label: i for i, label in enumerate(scalar_labels(sweep.features.groups))}
    triplets = result.scalars[:, [place[key] for key in TRIPLET]]
    return result.status, triplets, result.scalars[:, place["distance"]]


def labels_of(
    judge: Atlas | None,
    status: NDArray[np.int64],
    triplets: Array,
    distance: Array,
    radius: Array,
) -> list[str]:
    """Name runs by an atlas; without one by whether they end inside the ball they began in."""
    if judge is None:
        return ["inside" if inside else "outside" for inside in distance <= radius]
    names = judge.classify(triplets).name
    return [
        name if code == Status.DONE else Status(code).name.lower()
        for name, code in zip(names, status.tolist(), strict=True)
    ]


def compare(before: Sequence[str], after: Sequence[str]) -> dict[str, Any]:
    """Count labels that changed, with a Wilson interval, and the change of each class's share."""
    found = change(before, after)
    low, high = (float(end) for end in wilson_interval(found["changed"], len(before)))
    return found | {"share": found["changed"] / max(len(before), 1), "low": low, "high": high}


def _summary(cells: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how firm the modal classes of all cells are."""
    stays = np.array([cell["stays"] for cell in cells if "stays" in cell])
    return {
        "cells": len(stays),
        "mean": float(stays.mean()) if len(stays) else None,
        "below_95": int(np.sum(stays < 0.95)),
        "expected_changes": float(np.sum(1.0 - stays)),
    }


def _line(entry: Mapping[str, Any]) -> str:
    parts = [f"{entry[way]['changed']} {way}" for way in WAYS if way in entry]
    return f"of {entry['points']} points changed: {', '.join(parts)}"
