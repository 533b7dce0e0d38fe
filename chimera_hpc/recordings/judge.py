"""Features, variations and class of a prepared recording."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.base.wording import number_of
from chimera_hpc.classify import tree
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.job import Sweep
from chimera_hpc.job.registry import MEASURES
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.conventions import preset_settings
from chimera_hpc.measures.fourier import NodeFeatures, measure_signals
from chimera_hpc.measures.quality import FEW_SAMPLES
from chimera_hpc.measures.variation import total_variations
from chimera_hpc.measures.windows import hidden_windows, maxima
from chimera_hpc.recordings.columns import STILL, how_to_drop, some_of
from chimera_hpc.recordings.gaps import called
from chimera_hpc.recordings.preparing import Prepared
from chimera_hpc.reduction.atlases import load_atlas
from chimera_hpc.reduction.conventions import OWN, conventions
from chimera_hpc.store.store import Store

Array = NDArray[np.float64]

_FLAT = 1e-12
"""Standard deviation, in root mean squares of the signal, below which it is steady: rounding."""
_FAINT = 1e-6
"""The same, below which a line says so."""
_POOR = 0.3
"""Share of a node's variance in its sine below which its features say little."""
_SMALL = 1e-2
"""The same, below which the threshold of a sweep counts."""
_TURNS = 1.5
"""Turns in a window below which a node's sine is that of a drift."""
_BLOCKS = 20
_MAXIMA = 1.02
"""Maxima a turn of the clock beyond which some are put down to noise."""
_ALIKE = 3.0
"""Factor between frequencies or amplitudes from which units are taken for different."""


@dataclass(frozen=True, eq=False)
class Judge:
    """An atlas with what is to be known of the sweep that it comes from."""

    path: Path
    atlas: Atlas
    step: float
    settings: Features
    frequency: float
    """Median over runs and nodes."""
    amplitude: float
    nodes: int | None = None
    """Of each run; None for signals on links or triangles."""
    pairs: str = "ring"
    """Over which variations were taken: "ring", "links" or "order"."""
    model: str = ""
    """Of the sweep, as its job names it."""

    def __str__(self) -> str:
        return f"{self.path}, runs of {self.model}" if self.model else str(self.path)

    @classmethod
    def load(cls, path: Path, preset: str | None = None) -> Judge:
        """Read the atlas of a reduced sweep, from its folder or its store; BadInput without one.

        With a preset, the atlas is that of the sweep's triplets under it; BadInput if it has none.
        """
        folder = path.parent if (path / "zarr.json").is_file() else path
        store = Store.open(folder / "store.zarr")
        settings, convention = _measured_by(folder, store.sweep, preset)
        atlas = load_atlas(folder, convention)
        if not atlas.names:
            raise BadInput(f"{folder}: no run of this sweep oscillates: it has no classes")
        sweep, typical = store.sweep, _typical(store)
        nodes = sweep.n_nodes if sweep.signals == "nodes" else None
        step = sweep.integrator.t_step
        return cls(folder, atlas, step, settings, *typical, nodes, sweep.pairs, sweep.model)


def _measured_by(folder: Path, sweep: Sweep, preset: str | None) -> tuple[Features, str]:
    """Return the settings of a sweep's triplets under a preset, and the name of their atlas."""
    if preset is None:
        return sweep.features, OWN
    settings = sweep.features.model_copy(update=dict(preset_settings(preset)))
    if settings == sweep.features:
        return settings, OWN
    if preset not in conventions(sweep):
        other = f', or one with "{preset}" in [measures] panel' if preset in MEASURES else ""
        raise BadInput(
            f"--preset {preset}: the runs of {folder} were not measured by it; a sweep with "
            f'[features] preset = "{preset}" is needed{other}'
        )
    return settings, preset


@dataclass(frozen=True)
class Verdict:
    """The class of a triplet by an atlas, and how far to trust it."""

    name: str
    distance: float
    """To the nearest training point, in scaled variations."""
    confidence: float
    """Share of the training points whose own nearest neighbour is at least as far away."""
    other: str
    """The nearest other class."""
    other_distance: float

    @property
    def outside(self) -> bool:
        """Whether it is farther from the nearest run than any run of the atlas is from the next."""
        return self.confidence == 0.0

    @property
    def sentence(self) -> str:
        """How far to trust it, in words."""
        if self.confidence >= 0.05:
            where = "among the atlas's own runs"
        elif self.outside:
            where = "farther than any of the atlas's own runs is from its next: outside"
        else:
            where = "at the edge of the atlas's runs"
        return where


@dataclass(frozen=True, eq=False)
class Measured:
    """What came out of a recording."""

    features: NodeFeatures
    triplet: tuple[float, float, float]
    samples_a_period: float
    """Of the recording, for the fastest node; NaN without features."""
    verdict: Verdict | None
    warnings: tuple[str, ...]

    @property
    def name(self) -> str | None:
        """The class: of the atlas, ``steady`` or ``no_window``; None without or outside one."""
        if self.features.status is not Status.DONE and self.verdict is None:
            return self.features.status.name.lower()
        return None if self.verdict is None or self.verdict.outside else self.verdict.name


def measure(
    made: Prepared,
    settings: Features,
    ring: bool,
    judge: Judge | None,
    absolute: bool = False,
    pairs: NDArray[np.int64] | None = None,
) -> Measured:
    """Measure signals on an even grid, and judge them by an atlas if there is one.

    settings: windows, clock and the other settings; ``start`` and ``groups`` are not used.
    ring: whether the last node is a neighbour of the first.
    absolute: whether the user sets ``steady_threshold``, in the unit of the signal.
    pairs (M, 2): pairs of nodes over which variations are taken, in place of ring or chain.

    Raises BadInput: fewer than three nodes (two for a chain), or as `fourier_features`.
    """
    n_nodes, least = made.u.shape[1], 3 if ring else 2
    if n_nodes < least and pairs is None:
        what = "ring" if ring else "chain"
        raise BadInput(f"{number_of(n_nodes, 'node')}: a {what} has at least {least}")
    limit, warnings = _steady_below(made.u, settings.steady_threshold, judge, absolute)
    features = features_of(made, settings, limit)
    triplet = total_variations(features, ring=ring, pairs=pairs)
    fastest = float(np.nanmax(np.append(features.frequency, 0.0)))
    samples = 1.0 / (fastest * made.recorded_step) if fastest > 0.0 else float("nan")
    for what, step in (("the recording", made.recorded_step), ("the grid", made.step)):
        count = 1.0 / (fastest * step) if fastest > 0.0 else FEW_SAMPLES
        if count < FEW_SAMPLES and (step, what) != (made.recorded_step, "the grid"):
            node = called(made.names[int(np.nanargmax(features.frequency))])
            warnings.append(
                f"{what} has {count:.3g} samples per period ({node}); below "
                f"{FEW_SAMPLES:g} maxima and windows are placed coarsely"
            )
    warnings += _hidden(made, settings, features)
    warnings += _noise(made, settings, features)
    warnings += _poor(made, settings, features)
    verdict = None
    if judge is not None and np.isfinite(triplet).all():
        verdict = verdict_of(judge.atlas, np.array(triplet))
        warnings += _unlike(features, judge) if features.status is Status.DONE else []
        warnings += _other_pairs(n_nodes, pairs is not None, judge)
    return Measured(features, triplet, samples, verdict, tuple(warnings))


def features_of(
    made: Prepared, settings: Features, steady_threshold: float | None = None
) -> NodeFeatures:
    """Return the Fourier features of a prepared recording; steady is relative unless told."""
    options = settings.options()
    own = max(_FLAT * _size(made.u), sys.float_info.min)
    limit = own if steady_threshold is None else steady_threshold
    return measure_signals(made.t, made.u, **{**options, "steady_threshold": limit})


def _size(u: Array) -> float:
    """Root of the mean square of all values."""
    return float(np.sqrt(np.mean(np.square(u))))


def _steady_below(
    u: Array, threshold: float, judge: Judge | None, absolute: bool
) -> tuple[float, list[str]]:
    """Return the standard deviation below which signals are steady, and warnings.

    It is relative to the signal: `_FLAT` of the root mean square. That of the sweep or the user has
    the unit of the signal: the user's is taken, the sweep's only for what is small in itself too.
    """
    deviation, size = float(u.std(axis=0).mean()), _size(u)
    own = max(_FLAT * size, sys.float_info.min)
    if own <= deviation < min(_FAINT * size, threshold if absolute else np.inf):
        return own, [f"signals vary by {deviation:.3g} (standard deviation) round a level of "
                     f"{size:.6g}: rounding, or the output of a solver at rest?"]  # fmt: skip
    if deviation >= threshold or deviation < own or not (absolute or judge is not None):
        return (threshold if absolute else own), []
    said = (
        f"signals vary by {deviation:.3g} (standard deviation), less than steady_threshold = "
        f"{threshold:g} in the unit of the signal"
    )
    if absolute or deviation < _SMALL * size:
        return threshold, [f"steady: {said}"]
    return own, [f"{said}: the sweep would call it steady; other units? --factors or --rescale"]


def verdict_of(atlas: Atlas, triplet: Array) -> Verdict:
    """Judge one triplet (3,) by an atlas.

    The class is that of the nearest training point. The confidence compares the distance to it with
    the distances of the training points to one another.
    """
    found = atlas.classify(triplet)
    label, distance = int(found.label[0]), float(found.distance[0])
    spacing = np.asarray(cKDTree(atlas.points).query(atlas.points, k=2)[0])[:, 1]
    others = atlas.labels != label
    name, far = "", float("inf")
    if others.any():
        scaled = tree.scale(triplet[None], atlas.scaler)
        away, nearest = cKDTree(atlas.points[others]).query(scaled[0])
        name, far = atlas.names[int(atlas.labels[others][nearest])], float(away)
    confidence = float(np.mean(spacing >= distance))
    return Verdict(found.name[0], distance, confidence, name, far)


def with_relative_prominence(made: Prepared, settings: Features, judge: Judge) -> Features:
    """Return the settings with the prominence in the unit of a recording that is not scaled yet."""
    amplitude = float(np.sqrt(2.0) * np.median(made.u.std(axis=0)))
    return settings.model_copy(
        update={"prominence": settings.prominence * amplitude / judge.amplitude}
    )


def scale_to(features: NodeFeatures, judge: Judge) -> tuple[float, float]:
    """Return the factors on times and signals that make their medians those of the atlas."""
    if features.status is not Status.DONE:
        raise BadInput(f"--rescale: {features.status.sentence}")
    frequency = float(np.median(features.frequency))
    amplitude = float(np.median(features.amplitude))
    if not (frequency > 0.0 and amplitude > 0.0 and judge.frequency > 0.0):
        raise BadInput("--rescale: half of the nodes stand still")
    return frequency / judge.frequency, judge.amplitude / amplitude


def _hidden(made: Prepared, settings: Features, features: NodeFeatures) -> list[str]:
    """Return a line where nodes have no window because their maxima are too low to count."""
    if features.status is not Status.NO_WINDOW:
        return []
    hidden = hidden_windows(np.ascontiguousarray(made.u.T), settings.n_peaks, settings.prominence)
    names = [made.names[i] for i in np.flatnonzero(hidden)]
    return [f"{some_of(names)}: fewer than n_peaks = {settings.n_peaks} maxima of prominence = "
            f"{settings.prominence:g} in the unit of the signal: other units? --factors, --rescale "
            "or --set prominence=X"] if names else []  # fmt: skip


def _noise(made: Prepared, settings: Features, features: NodeFeatures) -> list[str]:
    """Return a line where the clock has many more maxima than turns: windows follow them."""
    if features.status is not Status.DONE or settings.window_reference == "own":
        return []
    node = settings.reference_node
    count = len(maxima(np.ascontiguousarray(made.u[:, node]), settings.prominence))
    turns = float(features.frequency[node] * (made.t[-1] - made.t[0]))
    if count <= _MAXIMA * turns + 1.0:
        return []
    return [
        f"{called(made.names[node])}, the clock, has {count} maxima in {turns:.0f} turns: noise? "
        "Windows follow the maxima; --lowpass F damps frequencies above F"
    ]


def _poor(made: Prepared, settings: Features, features: NodeFeatures) -> list[str]:
    """Return a line where sines are a small part of what nodes do: noise, drift, an outlier."""
    if features.status is not Status.DONE:
        return []
    spread = made.u.std(axis=0)
    moving = spread > STILL * np.median(spread)  # the others are named already
    share = 0.5 * (features.amplitude / np.where(moving, spread, np.inf)) ** 2
    if 2 * np.sum((share < _POOR) & moving) > len(share):
        return [f"a sine holds only {float(np.median(share)):.0%} of the variance of the median "
                "node: amplitudes, frequencies and phases say little"]  # fmt: skip
    own = settings.window_reference == "own"
    clocks = features.frequency if own else features.frequency[settings.reference_node]
    turns = (settings.n_peaks - 1) * features.frequency / np.maximum(clocks, 1e-300)
    poor = np.flatnonzero(((share < _POOR) | (turns < _TURNS)) & moving).tolist()
    names = [made.names[i] for i in poor]
    return [f"{some_of(names)}: a sine holds less than {_POOR:.0%} of the variance, or has fewer "
            f"than {_TURNS:g} turns in a window: noise, drift or outliers? {how_to_drop(names)}"
            ] if poor else []  # fmt: skip


def _unlike(features: NodeFeatures, judge: Judge) -> list[str]:
    """Return a line for each unit of the recording, of time or signal, that seems another one."""
    units = (
        ("frequency", features.frequency, judge.frequency, "V_Omega has the unit of frequency"),
        ("amplitude", features.amplitude, judge.amplitude, "V_a has the unit of the signal"),
    )
    return [
        f"the median {name} is {np.median(values):.3g}, that of the atlas's runs {typical:.3g}: "
        f"{what}; --factors or --rescale"
        for name, values, typical, what in units
        if not 1.0 / _ALIKE < max(float(np.median(values)), 1e-300) / typical < _ALIKE
    ]


def _other_pairs(n_nodes: int, network: bool, judge: Judge) -> list[str]:
    """Return lines where the atlas's runs have other neighbours, or another number of nodes."""
    lines = []
    if network != (judge.pairs == "links"):
        theirs = "links of a network" if judge.pairs == "links" else "neighbours on a ring"
        how = "--links FILE gives them" if judge.pairs == "links" else "leave --links out"
        lines.append(f"the variations of the atlas's runs were taken over {theirs}: {how}")
    if judge.nodes is not None and judge.nodes != n_nodes:
        lines.append(f"{n_nodes} nodes, but the atlas's runs have {judge.nodes}: along a smooth "
                     "state, neighbours differ less the more nodes there are")  # fmt: skip
    return lines


def _typical(store: Store) -> tuple[float, float]:
    """Return median frequency and amplitude over nodes and oscillating runs of some blocks."""
    done = store.ledger()["status"] == Status.DONE
    blocks = np.unique(np.flatnonzero(done) // store.block_size)
    some = blocks[np.unique(np.linspace(0, len(blocks) - 1, _BLOCKS).astype(np.int64))]
    tables = [store.files.read("features", int(block)) for block in some]
    table = np.concatenate(tables)
    return float(np.nanmedian(table[:, 1])), float(np.nanmedian(table[:, 0]))
