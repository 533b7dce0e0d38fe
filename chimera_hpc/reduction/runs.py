"""The runs that a reduction draws: read from the store, or integrated again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Cut
from chimera_hpc.classify.modes import count_votes
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.tables import Keep
from chimera_hpc.network.network import Network
from chimera_hpc.network.sweep_network import network_of
from chimera_hpc.plot.figure_input import DrawnRun
from chimera_hpc.plot.raster import NodeSeries
from chimera_hpc.reduction.cells import FreeAxis, describe
from chimera_hpc.reduction.selection import find_point, single_point
from chimera_hpc.store.schema import decode_series, sample_times, series_mask
from chimera_hpc.store.store import Store
from chimera_hpc.store.strips import SeriesInMemory

Array = NDArray[np.float64]


def shown_runs(
    store: Store,
    status: NDArray[np.int64],
    triplets: Array,
    cut: Cut,
    names: Sequence[str | None],
    axes: Sequence[FreeAxis],
    say: Callable[[str], None],
) -> list[DrawnRun]:
    """Return the runs of ``reduction.show``, without it a run of each class of the cut."""
    selections = store.sweep.reduction.show
    if not selections:
        chosen = representatives(store.sweep, store.points, cut)
    else:
        chosen = []
        for text in selections:
            i = find_point(store.points, text)
            if i is None:
                say(f"not shown: {text} is not in this sweep")
            elif not Status(int(status[i])).is_result:
                say(f"not shown: {text}: {Status(int(status[i])).sentence}")
            else:
                chosen.append(i)
    return [_load(store, i, names[i] or "", triplets[i], axes, say) for i in chosen]


def representatives(sweep: Sweep, points: Points, cut: Cut) -> list[int]:
    """Return for each class a run of the cell with most votes for it, a kept one where possible."""
    cell = points.cells()[0]
    votes = count_votes(cell, cut.labels, int(cell.max(initial=-1)) + 1)
    kept = series_mask(sweep, points.columns["seed"])
    chosen = []
    for label in range(len(cut.names)):
        runs = np.flatnonzero((cut.labels == label) & (cell == votes[:, label].argmax()))
        chosen.append(int(runs[np.argmax(kept[runs])]))
    return chosen


def whole_runs(
    sweep: Sweep,
    first: dict[str, int | float],
    axes: Sequence[FreeAxis],
    say: Callable[[str], None],
) -> list[DrawnRun]:
    """Return the runs of ``reduction.replay``, integrated from 0 to t_end."""
    runs = []
    for text in sweep.reduction.replay:
        single = single_point(sweep, first, text)
        points = single.points()
        u, status = _integrate(single, points)
        if status.is_failure:
            say(f"not drawn: {text}: {status.sentence}")
            continue
        row = points.row(0)
        network, size = drawn_network(single, row, say), single.observed(points)[0]
        made = DrawnRun(_place(row, axes), sample_times(single), SeriesInMemory(u[:, :size]))
        runs.append(replace(made, network=network, signals=single.signals))
    return runs


def _load(
    store: Store,
    i: int,
    class_name: str,
    triplet: Array,
    axes: Sequence[FreeAxis],
    say: Callable[[str], None],
) -> DrawnRun:
    """Return a run of the store; its series is computed again where it is not kept."""
    row = store.points.row(i)
    place, features = _place(row, axes), None
    oscillates = bool(np.isfinite(triplet).all())
    if oscillates:
        block, place_in_block = divmod(i, store.block_size)
        features = np.array(store.files.read("features", block)[place_in_block])
        features = features[:, : store.size(i)]
    t, u = sample_times(store.sweep), node_series(store, i)
    return DrawnRun(
        *(place, t, u, class_name, features, triplet if oscillates else None),
        network=drawn_network(store.sweep, row, say),
        signals=store.sweep.signals,
    )


def drawn_network(
    sweep: Sweep, row: Mapping[str, int | float], say: Callable[[str], None]
) -> Network | None:
    """Return the network of a point to draw; None without [network], or where it cannot be made."""
    if sweep.network is None:
        return None
    try:
        return network_of(sweep, row)
    except BadInput as error:
        say(f"network not drawn: {error}")
        return None


def node_series(store: Store, i: int) -> NodeSeries:
    """Return the series of a point node by node; it is computed again where it is not kept."""
    if series_mask(store.sweep, store.points.columns["seed"][i : i + 1]).all():
        return store.node_series(i)
    return SeriesInMemory(_integrate(store.sweep, store.points[i : i + 1], store.starts([i]))[0])


def series_of(store: Store, i: int) -> Array:
    """Return the series (T, N) of a point; it is computed again where it is not kept."""
    if series_mask(store.sweep, store.points.columns["seed"][i : i + 1]).all():
        return store.series(i)
    stored, _ = _integrate(store.sweep, store.points[i : i + 1], store.starts([i]))
    return decode_series(stored)


def _place(row: Mapping[str, int | float], axes: Sequence[FreeAxis]) -> str:
    return ", ".join(filter(None, [describe(row, axes, math=True), f"seed {row['seed']}"]))


def _integrate(
    sweep: Sweep, points: Points, starts: Array | None = None
) -> tuple[NDArray[Any], Status]:
    """Compute one point as a task does; return its series (T, N), float32, and its status."""
    from chimera_hpc.run.block import run_block

    keep = Keep(series="all", dtype="float32")
    result = run_block(sweep.model_copy(update={"keep": keep}), points, starts=starts)
    series: NDArray[Any] | None = result.series
    assert series is not None
    return series[0], Status(int(result.status[0]))
