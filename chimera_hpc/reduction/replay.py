"""Recomputes points of a sweep with the same kernels, for pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.modes import run_names
from chimera_hpc.job import Sweep
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.fourier import window_lines
from chimera_hpc.plot.raster import NodeSeries
from chimera_hpc.plot.spectrum import Spectrum
from chimera_hpc.plot.style import drawn
from chimera_hpc.reduction.cells import describe, free_axes
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.ledger import digests
from chimera_hpc.store.schema import sample_times
from chimera_hpc.store.store import Store
from chimera_hpc.store.strips import SeriesInMemory

Array = NDArray[np.float64]

_AT_ONCE = 10**7
"""Samples of all nodes and points up to which points are computed together."""
_MOST_W = 4 * 10**6
"""Samples of w that are kept: portraits and films show the last periods only."""


@dataclass(frozen=True, eq=False)
class Replay:
    """One point computed again.

    point: its number in the store.
    title: parameters that vary, seed and class.
    t (T,): sample times of the analysis interval.
    u: as it is stored, missing after the end of a run that failed.
    w (T', N): the second signal, at the last T' times; T' = 0 where it was not asked for.
    features (8, N): NaN unless the status is DONE.
    triplet (3,): V_theta, V_a, V_Omega.
    digest, stored: digest of what came out now, and of what the store holds, None where the point
        never ran.
    class_name: class by the last reduction; None without one.
    """

    point: int
    title: str
    t: Array
    u: SeriesInMemory
    w: Array
    status: Status
    features: Array
    triplet: Array
    n_windows: int
    digest: int
    stored: int | None
    class_name: str | None

    @property
    def is_same(self) -> bool:
        """Whether the result is the stored one, bit for bit."""
        return self.digest == self.stored

    @property
    def begins(self) -> bool:
        """Whether there is anything to draw."""
        return bool(np.isfinite(self.u.at(slice(0, 1))).any())

    @property
    def is_whole(self) -> bool:
        """Whether the run came to its end."""
        return bool(np.isfinite(self.u.at(slice(-1, None))).all())

    @property
    def period(self) -> float:
        """Median over the nodes, NaN without features."""
        frequency = float(np.median(self.features[1]))
        return 1.0 / frequency if frequency > 0.0 else float("nan")


def replay(store: Store, chosen: Sequence[int], focus: int | None = None) -> Iterator[Replay]:
    """Yield points of a store, computed again; their bits do not depend on one another.

    Large ones are computed one after the other, as they are asked for: only one has its buffers in
    memory, and u of those before it is needed no more once it is reduced to a picture.

    focus: the only one of them whose w is kept; without it, that of all is.
    """
    ledger, names = store.ledger(), classes_of(store)
    size = store.sweep.n_observed * len(sample_times(store.sweep))
    at_once = len(chosen) if size * len(chosen) <= _AT_ONCE else 1
    for first in range(0, len(chosen), at_once):
        which = np.asarray(chosen[first : first + at_once], dtype=np.int64)
        yield from _computed(store, which, focus, ledger, names)


def _computed(
    store: Store,
    which: NDArray[np.int64],
    focus: int | None,
    ledger: Mapping[str, NDArray[np.int64]],
    names: Sequence[str | None],
) -> list[Replay]:
    """Compute points together."""
    from chimera_hpc.run.block import run_block

    signals: dict[int, tuple[SeriesInMemory, Array]] = {}

    def keep(row: int, u: NDArray[Any], w: Array) -> None:
        few = max(1, min(len(u), _MOST_W // u.shape[1]))
        first = len(u) - few if focus in (None, which[row]) else len(u)
        # The buffer of a single point is not used again.
        signals[row] = SeriesInMemory(u if len(which) == 1 else u.copy()), w[:, first:].T.copy()

    starts = store.starts(which)
    # A result with room for the series would hold them a second time.
    series = store.sweep.keep.model_copy(update={"series": "none"})
    sweep = store.sweep.model_copy(update={"keep": series})
    made = run_block(sweep, store.points[which], on_signals=keep, starts=starts)
    times, found = sample_times(store.sweep), digests(made.features, made.scalars)
    return [
        Replay(
            point=i,
            title=_title(store, i, names[i]),
            t=times,
            u=signals[row][0],
            w=signals[row][1],
            status=Status(int(made.status[row])),
            features=made.features[row, :, : signals[row][0].shape[0]],
            triplet=made.scalars[row, : len(TRIPLET)],
            n_windows=int(made.n_windows[row]),
            digest=int(found[row]),
            stored=None if ledger["status"][i] == Status.NEVER else int(ledger["digest"][i]),
            class_name=names[i],
        )
        for row, i in enumerate(which.tolist())
    ]


def classes_of(store: Store) -> list[str | None]:
    """Return the class of every point in the first cut of the last reduction, None without one.

    Runs that do not oscillate are ``steady`` or ``no_window``.
    """
    try:
        stored = store.reduction()
    except BadInput:
        return [None] * store.n_points
    asked = store.sweep.reduction.cuts or stored.attributes["cuts"]
    labels = stored.arrays.get(f"labels_{asked[0]}")
    if labels is None or len(labels) != store.n_points:
        return [None] * store.n_points
    names = stored.attributes[f"names_{asked[0]}"][:-2]
    return run_names(labels, store.ledger()["status"], names)


def representative(store: Store, chosen: Sequence[int]) -> int:
    """Return the one of these points that stands for them all.

    Of those in their most frequent class it is the one nearest to their median triplet, each
    variation in units of its spread; the first point where none has a triplet.
    """
    names, scalars = classes_of(store), store.scalars()
    triplets = np.stack([scalars[name][list(chosen)] for name in TRIPLET], axis=1)
    usable: NDArray[np.bool_] = np.asarray(np.isfinite(triplets).all(axis=1))
    if not usable.any():
        return int(chosen[0])
    called = [names[i] for i in chosen]
    votes = [name for name, ok in zip(called, usable, strict=True) if ok]
    modal = max(dict.fromkeys(votes), key=votes.count)
    mine = usable & np.array([name == modal for name in called])
    offset = np.abs(triplets[mine] - np.median(triplets[mine], axis=0))
    spread = np.ptp(triplets[mine], axis=0)
    distance = (offset / np.where(spread > 0.0, spread, 1.0)).sum(axis=1)
    return int(np.asarray(chosen)[mine][np.argmin(distance)])


def window_spectrum(
    t: Array, u: NodeSeries, settings: Features, node: int, window: int
) -> tuple[Spectrum, str]:
    """Return the Fourier fit of one node in one window, and a line that describes it.

    t (T,), u (N, T): a run that was measured by these settings, and oscillates; node, window: both
    from 0. Only the node and the one whose maxima place the windows are read.

    Raises BadInput: there is no such node or window.
    """
    if not 0 <= node < u.shape[0]:
        raise BadInput(f"--node {node}: allowed is 0 to {u.shape[0] - 1}")
    options = settings.options()
    del options["phase_mean"], options["steady"]
    y = u[node : node + 1]
    clock = node if settings.window_reference == "own" else settings.reference_node
    rows = np.concatenate([u[clock : clock + 1], y])
    # The mean deviation of these two is not that of the run.
    lines = window_lines(t, rows.T, **{**options, "reference_node": 0, "steady_threshold": 0.0})
    row = len(lines.counts) - 1
    count = int(lines.counts[row])
    if not 0 <= window < count:
        raise BadInput(f"--window {window}: allowed is 0 to {count - 1}")
    part = slice(int(lines.first[row, window]), int(lines.last[row, window]) + 1)
    y, place = y[0, part], (1, window)
    samples = y - y.mean()
    amplitude = 2.0 / len(y) * np.abs(np.fft.rfft(samples))
    frequency = np.fft.rfftfreq(len(y), (t[-1] - t[0]) / (len(t) - 1))
    found = {k: float(getattr(lines, k)[place]) for k in ("amplitude", "frequency", "phase")}
    origin = {"absolute": 0.0, "recording": t[0]}.get(settings.time_origin, t[part][0])
    angle = 2.0 * np.pi * found["frequency"] * (t[part] - origin) + found["phase"]
    fit = lines.baseline[place] + found["amplitude"] * np.cos(angle)
    peak = 1 + int(amplitude[1:].argmax())
    text = (
        f"node {node}, window {window} of {count}: {len(y)} samples, "
        f"frequency {found['frequency']:.6g} (largest line {frequency[peak]:.6g}), "
        f"amplitude {found['amplitude']:.6g}, phase {found['phase']:.6g} rad"
    )
    return Spectrum(t[part], y, frequency, amplitude, peak, fit), text


def _title(store: Store, i: int, name: str | None) -> str:
    axes = [axis for axis in store.points.axes if axis != "seed"]
    row = store.points.row(i)
    free = free_axes(store.points.cells()[1], axes)
    place = ", ".join(filter(None, [describe(row, free, math=True), f"seed {row['seed']}"]))
    return "\n".join(filter(None, [place, drawn(name or "")]))


def has_nullcline(sweep: Sweep) -> bool:
    """Whether w = u - u^3 / 3 is the nullcline of the model's first variable, without coupling."""
    return sweep.model == "topological_fhn"
