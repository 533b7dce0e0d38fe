"""How firm the labels are: a random share of all points, run again in three ways.

At 100 times tighter tolerance; with the initial state moved by 1e-13 at the old tolerance (the
control: trajectories are chaotic, so that labels near borders flip without any fault of the
integrator); and to t = 5000, analysed over a stretch as long as before (are chimeras transients?).
Every run is judged by its sweep's own atlas, or by the first one that its job names. Then the votes
of each cell are resampled over the seeds: how often the modal class comes out the same.
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

from chimera_hpc.grid import Points, Sweep
from chimera_hpc.grid.tables import Keep
from chimera_hpc.outputs.atlases import load_atlas, sibling
from chimera_hpc.reduce.atlas import Atlas
from chimera_hpc.reduce.results import TRIPLET
from chimera_hpc.reduce.robustness import wilson_interval
from chimera_hpc.status import Status
from chimera_hpc.store import Store
from chimera_hpc.store.labelled import STORE_NAME

_SHORT = ("networks", "networks-2", "synthetic", "stability")
"""Jobs without classes."""
_BASINS = ("basin", "basin-200")
_TIGHTER, _MOVED, _LATE = 100.0, 1e-13, 5000.0
_PIECE = 8
_DRAWS = 1000
_STEADY = "steady"
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
        for number, name in enumerate(names):
            if name in _SHORT or not (folder / name / STORE_NAME).is_dir():
                continue
            rng = np.random.default_rng([20, number])
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
    chosen = np.sort(rng.choice(usable, size, replace=False))
    basin = name in _BASINS
    which = WAYS[:2] if basin else WAYS
    judge = None if basin else _judge(folder, store)
    points = store.points
    radius = points.columns["delta"][chosen]
    triplets = np.stack([scalars[key] for key in TRIPLET], axis=1)
    before = labels_of(judge, status[chosen], triplets[chosen], scalars["distance"][chosen], radius)
    entry: dict[str, Any] = {"points": size, "of": store.n_points}
    for way in which:
        pieces = [chosen[i : i + _PIECE] for i in range(0, size, _PIECE)]
        made = list(pool.map(_again, [(store.sweep, points[p], way) for p in pieces]))
        state, again, distance = (np.concatenate([m[k] for m in made]) for k in range(3))
        entry[way] = compare(before, labels_of(judge, state, again, distance, radius))
    if not basin:
        entry["bootstrap"] = bootstrap_cells(folder, rng)
    return entry


def _judge(folder: Path, store: Store) -> Atlas:
    named = store.sweep.reduction.atlas
    return load_atlas(sibling(folder, named[0]) if named else folder)


def _again(task: tuple[Sweep, Points, str]) -> tuple[NDArray[np.int64], Array, Array]:
    """Run points again one way: status, triplets and final distances."""
    from chimera_hpc.layout import scalar_labels
    from chimera_hpc.task import run_block

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
    changed = sum(one != other for one, other in zip(before, after, strict=True))
    low, high = (float(end) for end in wilson_interval(changed, len(before)))
    first, second = Counter(before), Counter(after)
    return {
        "changed": changed,
        "share": changed / max(len(before), 1),
        "low": low,
        "high": high,
        "net": {
            name: (second[name] - first[name]) / max(len(before), 1)
            for name in sorted({*first, *second})
        },
        "moves": dict(Counter(f"{a} to {b}" for a, b in zip(before, after, strict=True) if a != b)),
    }


def bootstrap_cells(folder: Path, rng: np.random.Generator) -> dict[str, Any]:
    """Resample the seeds of every cell: how often the modal class stays what it is."""
    from chimera_hpc.paper.evidence import family_of
    from chimera_hpc.reduce.results import read_results

    results = read_results(folder / "results.json")
    cut = next(iter(results["cuts"].values()))
    size = {cluster["name"]: cluster["size"] for cluster in cut["clusters"]}
    stays = []
    for cell in cut["cells"]:
        if cell["votes"]:
            stays.append(modal_stays(cell["votes"], family_of(cell["votes"], size), size, rng))
    return {
        "cells": len(stays),
        "mean": float(np.mean(stays)) if stays else None,
        "below_95": int(np.sum(np.array(stays) < 0.95)),
        "expected_changes": float(len(stays) - np.sum(stays)),
    }


def modal_stays(
    votes: Mapping[str, int],
    modal: str | None,
    size: Mapping[str, int],
    rng: np.random.Generator,
) -> float:
    """Share of resampled votes whose modal class is `modal`; ties go to the larger class."""
    from chimera_hpc.paper.evidence import base_of

    families: dict[str, int] = {}
    for name, count in votes.items():
        family = "ordered" if name == _STEADY else base_of(name)
        families[family] = families.get(family, 0) + count
    members = Counter[str]()
    for name, count in size.items():
        members[base_of(name)] += count
    names = sorted(families, key=lambda family: -members[family])
    counts = np.array([families[name] for name in names], dtype=np.float64)
    drawn = rng.multinomial(int(counts.sum()), counts / counts.sum(), size=_DRAWS)
    return float(np.mean([names[i] == modal for i in drawn.argmax(axis=1)]))


def _line(entry: Mapping[str, Any]) -> str:
    parts = [f"{entry[way]['changed']} {way}" for way in WAYS if way in entry]
    return f"of {entry['points']} points changed: {', '.join(parts)}"


def audit_table(audit: Mapping[str, Any]) -> str:
    """Return the audit as a Markdown table."""
    head = (
        "| job | points | changed at 100x tighter | changed, moved by 1e-13 | changed at t = 5000 "
    )
    lines = [f"{head}| modal classes that stay (bootstrap) |", "|---|---|---|---|---|---|"]
    for name, entry in audit.items():
        cells = [name, f"{entry['points']} of {entry['of']}"]
        for way in WAYS:
            made = entry.get(way)
            cells.append(
                f"{made['changed']} ({made['low']:.2f} to {made['high']:.2f})" if made else ""
            )
        boot = entry.get("bootstrap")
        known = boot and boot["mean"] is not None
        cells.append(
            f"{boot['mean']:.3f} over {boot['cells']} cells, {boot['below_95']} below 0.95"
            if known
            else ""
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
