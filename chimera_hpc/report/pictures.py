"""One run per cell to look at: a small space-time picture and the profiles of its features."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.modes import vote_labels
from chimera_hpc.job.tables import Keep
from chimera_hpc.plot.ordered import in_order
from chimera_hpc.plot.raster import NodeSeries, bins, close_up
from chimera_hpc.report.content import Content
from chimera_hpc.report.networks import DrawnNetworks
from chimera_hpc.store.schema import FEATURES, sample_times, series_mask
from chimera_hpc.store.strips import SeriesInMemory

Array = NDArray[np.float64]

MOST_CELLS = 600
MOST_BYTES = 5_500_000
"""Cells with a picture and profiles, and what these may take of the page in all."""
MOST_SECONDS = 20.0
"""Work on replaying runs whose series the store does not keep: a tenth of the sweep's, but at least
a quarter of this and at most this."""
_PERIODS = 8
_COLUMNS, _ROWS = 240, 128
"""Most samples of a picture along time and along the ring."""
_STEPS = 256
"""Most nodes in a profile."""
_COLOURS = 64
_PROFILES = ("amplitude", "phase", "frequency")
_BATCH, _BATCH_SAMPLES = 64, 10**7
"""Runs that are replayed in one go, and the most samples in all of them; a larger one is alone."""


@dataclass(frozen=True)
class Plates:
    """What cells carry in addition to their numbers."""

    by_cell: dict[int, dict[str, Any]]
    """Plain values for JSON by the number of the cell; the key `image` may be missing."""
    n_eligible: int
    """Cells with a run that has a result."""
    n_images: int
    most_cells: int
    replay: bool
    """Whether runs were replayed whose series the store does not keep."""
    networks: Sequence[dict[str, Any]] = ()
    """Networks that the key `network` of cells numbers, see `report.networks`."""
    ordered: bool = False
    """Whether rows of the pictures are in the order of the network."""

    @property
    def sentence(self) -> str:
        """How many cells carry what, and why not more."""
        n, profiles = self.n_eligible, len(self.by_cell)
        if self.n_images == profiles == n:
            return f"All {n} cells with results carry a picture and profiles."
        limit = f"for at most {MOST_SECONDS:g} s" if self.replay else "at the end of the run only"
        return (
            f"{self.n_images} of {n} cells with results carry a picture, "
            f"{'all' if profiles == n else profiles} carry profiles: at most {self.most_cells} "
            f"cells and {MOST_BYTES / 1e6:g} MB, spread evenly. Series that the store does not "
            f"keep are replayed {limit}; the command show replays any run."
        )


def plates(
    content: Content,
    shown: NDArray[np.int64],
    most_cells: int = MOST_CELLS,
    replay: bool = True,
) -> Plates:
    """Make the pictures and profiles of one run per cell, as far as their budget goes.

    The run is one of the cell's modal class, one whose series is kept where there is such a run.
    `shown` are the cells to choose from.
    """
    chosen = representatives(content)
    cells = shown[chosen[shown] >= 0]
    spread = cells[evenly_spread(len(cells))][:most_cells].tolist()
    kept = series_mask(content.store.sweep, content.store.points.columns["seed"])
    stored = [i for i in spread if kept[chosen[i]]]
    others = [i for i in spread if not kept[chosen[i]]]
    others = others[: affordable(content) if replay else 0]
    pictured = [*stored, *others]
    plain = [i for i in spread if i not in set(pictured)]
    networks = DrawnNetworks(content, _STEPS)
    pictures = _pictures(content, chosen[pictured], networks)
    profiles = _profiles_of(content, chosen[spread])
    made: dict[int, dict[str, Any]] = {}
    size = 0
    for i in (*pictured, *plain):
        point = int(chosen[i])
        plate = _plate(content, point, profiles[point]) | pictures.get(point, {})
        if (number := networks.number(point)) is not None:
            plate["network"] = number
        size += len(json.dumps(plate))
        if size > MOST_BYTES:
            break
        made[i] = plate
    images = sum("image" in plate for plate in made.values())
    return Plates(
        *(made, int((chosen >= 0).sum()), images, most_cells, replay),
        networks=networks.drawn,
        ordered=networks.ordered(chosen[spread[:1]].tolist()),
    )


def representatives(content: Content) -> NDArray[np.int64]:
    """Return for each cell the point that stands for it, -1 where none has a result.

    A run of the modal class comes before others, a run whose series is kept before others, the
    first before later ones.
    """
    cut = content.opening
    label = vote_labels(cut.labels, content.status, len(cut.names))
    typical = label == content.votes(cut).modal[content.cell]
    kept = series_mask(content.store.sweep, content.store.points.columns["seed"])
    with_result = np.flatnonzero(label >= 0)
    # With a stable sort the best of each cell comes first.
    order = np.lexsort((~kept[with_result], ~typical[with_result], content.cell[with_result]))
    best = with_result[order]
    found, first = np.unique(content.cell[best], return_index=True)
    chosen = np.full(content.n_cells, -1, dtype=np.int64)
    chosen[found] = best[first]
    return chosen


def evenly_spread(n: int) -> NDArray[np.int64]:
    """Return 0..n-1 in an order of which every first part is spread evenly: by reversed bits."""
    bits = max(1, math.ceil(math.log2(max(n, 2))))
    numbers = np.arange(n)
    reverse = np.zeros(n, dtype=np.int64)
    for bit in range(bits):
        reverse |= ((numbers >> bit) & 1) << (bits - 1 - bit)
    return np.argsort(reverse)


def affordable(content: Content) -> int:
    """Return how many runs may be replayed, by the time that the runs in the store took."""
    ran = content.status != Status.NEVER
    if not ran.any():
        return 0
    seconds = content.scan.columns["elapsed_us"][ran] / 1e6
    budget = min(MOST_SECONDS, max(MOST_SECONDS / 4, float(seconds.sum()) / 10))
    return int(budget / max(float(seconds.mean()), 1e-6))


def _pictures(
    content: Content, points: NDArray[np.int64], networks: DrawnNetworks
) -> dict[int, dict[str, Any]]:
    """Return the pictures of points.

    Made in the order of the store, in which neighbours may be integrated side by side.
    """
    ordered, signals = np.sort(points).tolist(), content.store.sweep.signals
    series = zip(ordered, _all_series(content, ordered), strict=True)
    return {i: _picture(t, in_order(u, networks.of(i), signals)) for i, (t, u) in series}


def _all_series(content: Content, points: Sequence[int]) -> Iterator[tuple[Array, NodeSeries]]:
    """Yield times and u node by node of points, read or replayed; in the order given."""
    store, t = content.store, sample_times(content.store.sweep)
    kept = series_mask(store.sweep, store.points.columns["seed"])
    size = min(_BATCH, max(1, _BATCH_SAMPLES // (len(t) * store.sweep.n_observed)))
    for start in range(0, len(points), size):
        batch = np.array(points[start : start + size], dtype=np.int64)
        missing = batch[~kept[batch]]
        replayed = dict(zip(missing.tolist(), _replay(content, missing), strict=True))
        for i in batch.tolist():
            if i in replayed:
                yield t, SeriesInMemory(replayed[i][:, : store.size(i)])
            else:
                yield t, store.node_series(i)


def _replay(content: Content, points: NDArray[np.int64]) -> NDArray[Any]:
    """Compute the series (n, T, N) of points again, float32."""
    if not len(points):
        return np.empty((0, 0, 0))
    from chimera_hpc.run.block import run_block

    sweep = content.store.sweep
    sweep = sweep.model_copy(update={"keep": Keep(series="all", dtype="float32")})
    store = content.store
    series = run_block(sweep, store.points[points], starts=store.starts(points)).series
    if series is None:
        raise BadInput(f"{content.store.path}: the model gives no series to draw")
    return series


def _profiles_of(content: Content, points: NDArray[np.int64]) -> dict[int, Array | None]:
    """Return the features (8, N) of points, read block by block; None where they are no numbers."""
    size, found = content.store.block_size, {}
    block, table = -1, np.empty(0)
    for i in sorted(points.tolist()):
        if i // size != block:
            block = i // size
            table = content.store.files.read("features", block)
        row = np.array(table[i % size][:, : content.store.size(i)], dtype=np.float64)
        found[i] = row if np.isfinite(row[: len(_PROFILES)]).all() else None
    return found


def _plate(content: Content, i: int, features: Array | None) -> dict[str, Any]:
    plate: dict[str, Any] = {
        "point": content.point_words(i),
        "status": Status(int(content.status[i])).sentence,
        "classes": {name: int(cut.labels[i]) for name, cut in content.named_cuts.items()},
    }
    if np.isfinite(content.triplets[i]).all():
        plate["variations"] = [rounded(v) for v in content.triplets[i].tolist()]
    return plate if features is None else plate | _profiles(features)


def _profiles(features: Array) -> dict[str, list[float | None]]:
    """Return each profile with what lies one deviation below and above, at some nodes of many."""
    starts, rows = bins(features.shape[1], _STEPS), dict(zip(FEATURES, features, strict=True))
    made = {"node": starts.astype(np.float64)}
    for name in _PROFILES:
        half = np.nan_to_num(rows[f"{name}_std"])
        made[name] = rows[name][starts]
        made[f"{name}_low"] = np.fmin.reduceat(rows[name] - half, starts)
        made[f"{name}_high"] = np.fmax.reduceat(rows[name] + half, starts)
    return {name: [rounded(v, 6) for v in values.tolist()] for name, values in made.items()}


def _picture(t: Array, u: NodeSeries) -> dict[str, Any]:
    """Return the last periods of a run as a PNG, with what it shows and its colour range."""
    raster = close_up(t, u, _ROWS, _COLUMNS, _PERIODS)
    largest = float(np.nanmax(np.abs(raster.values), initial=0.0)) or 1.0
    return {
        "image": _png(raster.values[::-1] / largest),
        "t": [rounded(x, 6) for x in raster.times],
        "nodes": list(raster.nodes),
        "part": raster.length,
        "largest": rounded(largest, 3),
    }


def _png(values: Array) -> str:
    """Return an image of values from -1 to 1 as a data URI."""
    steps = np.clip((np.nan_to_num(values) + 1.0) / 2.0 * _COLOURS, 0, _COLOURS - 1)
    image = Image.fromarray(steps.astype(np.uint8))
    image.putpalette(palette().tobytes())
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def palette(name: str = "viridis") -> NDArray[np.uint8]:
    """Return the colours of the pictures, (n, 3)."""
    colours = mpl.colormaps[name](np.linspace(0.0, 1.0, _COLOURS))[:, :3]
    return np.asarray(255 * colours).round().astype(np.uint8)


def rounded(value: float, digits: int = 4) -> float | None:
    """Return a number with so many significant digits, None for NaN and infinity."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None
