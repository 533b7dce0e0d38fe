"""What ``classify`` says of recordings: lines, JSON, figures."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chimera_hpc.cli.arguments import errors_in_one_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chimera_hpc.job.tables import Features
    from chimera_hpc.recordings.file import Recorded, Treatment
    from chimera_hpc.recordings.judge import Judge
    from chimera_hpc.recordings.many import Collection

_MOST_GAPS = 5


def lines(one: Recorded, how: Treatment, judge: Judge | None) -> Iterator[str]:
    """Yield what was found, for people."""
    made, found, scale = one.made, one.found, one.scale
    where = f"{made.t[0]:.9g} to {made.t[-1]:.9g}"
    yield f"{one.path}: {made.u.shape[1]} nodes in a {_shape(how)}, {where}"
    for note in made.notes:
        yield f"  {note}"
    if scale != (1.0, 1.0):
        yield f"  times multiplied by {scale[0]:.6g}, signals by {scale[1]:.6g}"
    for gap in made.gaps[:_MOST_GAPS]:
        yield f"  gap: {gap.text(made.names)}"
    if len(made.gaps) > _MOST_GAPS:
        yield f"  and {len(made.gaps) - _MOST_GAPS} more gaps"
    for warning in (*made.warnings, *found.warnings):
        yield f"warning: {warning}"
    features = found.features
    if not features.n_windows:
        yield features.status.sentence
    else:
        yield f"oscillates; {features.n_windows} windows"
        yield f"  {found.samples_a_period:.3g} samples per period in the recording"
        for name in ("amplitude", "frequency", "baseline"):
            values = getattr(features, name)
            yield (
                f"  {name:<10} median {np.median(values):.6g}, from {values.min():.6g} "
                f"to {values.max():.6g}"
            )
        for name, value in zip(("V_theta", "V_a", "V_Omega"), found.triplet, strict=True):
            yield f"  {name:<10} {value:.6g}"
    if judge is None:
        yield "class: none without --atlas STORE"
    else:
        yield f"class: {found.name or 'none'}, by {judge}"
    verdict = found.verdict
    if verdict is not None:
        yield f"  distance {verdict.distance:.3g} to the nearest run: {verdict.sentence}"
        yield f"  confidence {verdict.confidence:.2f}: share of its runs as far from the next one"
        if verdict.outside:
            yield f"  the nearest class is {verdict.name}"
        if verdict.other:
            yield f"  the nearest other class is {verdict.other}, at {verdict.other_distance:.3g}"


def _shape(how: Treatment) -> str:
    return "network" if how.links is not None else "ring" if how.ring else "chain"


def report(one: Recorded, how: Treatment, judge: Judge | None, files: list[Path]) -> dict[str, Any]:
    """Return what --json prints."""
    made, found, scale = one.made, one.found, one.scale
    verdict, features = found.verdict, found.features
    return {
        "file": str(one.path),
        "ring": how.ring and how.links is None,
        "links": None if how.links is None else str(how.links),
        "nodes": list(made.names),
        "samples": len(made.t),
        "start": float(made.t[0]),
        "end": float(made.t[-1]),
        "step": made.step,
        "recorded_step": made.recorded_step,
        "scale": {"time": scale[0], "signal": scale[1]},
        "samples_a_period": _number(found.samples_a_period),
        "gaps": [
            {
                "node": None if gap.node is None else made.names[gap.node],
                "from": gap.first,
                "to": gap.last,
                "samples": gap.samples,
            }
            for gap in made.gaps
        ],
        "notes": list(made.notes),
        "warnings": [*made.warnings, *found.warnings],
        "status": features.status.name.lower(),
        "windows": features.n_windows,
        "features": {
            name: [_number(x) for x in getattr(features, name).tolist()]
            for name in ("amplitude", "frequency", "phase", "baseline")
        },
        "variations": {
            name: _number(value)
            for name, value in zip(("V_theta", "V_a", "V_Omega"), found.triplet, strict=True)
        },
        "atlas": None if judge is None else str(judge.path),
        "atlas_model": None if judge is None else judge.model,
        "class": found.name,
        "nearest": None if verdict is None else verdict.name,
        "confidence": None if verdict is None else verdict.confidence,
        "distance": None if verdict is None else verdict.distance,
        "other": None
        if verdict is None or not verdict.other
        else {"class": verdict.other, "distance": verdict.other_distance},
        "figures": [str(file) for file in files],
    }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def draw(out: Path | None, one: Recorded, settings: Features, judge: Judge | None) -> list[Path]:
    """Draw the recording, its profiles, a spectrum, and its place in the atlas."""
    from chimera_hpc.plot.indicators import fourier_indicators, profiles_of, variations_text
    from chimera_hpc.plot.judged import judged
    from chimera_hpc.plot.spacetime import space_time
    from chimera_hpc.plot.spectrum import spectrum
    from chimera_hpc.plot.style import plain
    from chimera_hpc.recordings.gaps import called
    from chimera_hpc.reduction.replay import window_spectrum

    made, found = one.made, one.found
    words = [one.path.name, (found.name or "").replace("_", " ")]
    title, names = plain("\n".join(filter(None, words))), made.names
    figures = {"space_time": space_time([(made.t, made.u.T)], [title], names=names)}
    if found.features.n_windows:
        title = f"{title}\n{variations_text(found.triplet)}"
        profiles = [profiles_of(found.features.as_array())]
        figures["profiles"] = fourier_indicators(profiles, [title], names)
        node = settings.reference_node
        data, _ = window_spectrum(made.t, made.u.T, settings, node, 0)
        figures["spectrum"] = spectrum(data, plain(f"{called(names[node])}, window 0"))
    if judge is not None and found.verdict is not None:
        low, high = judge.atlas.scaler
        triplets = low + judge.atlas.points * (high - low)
        figures["atlas"] = judged(
            triplets, judge.atlas.labels, judge.atlas.names, found.triplet, found.verdict.name
        )
    return _save(out or Path(f"{one.path.name}-classified"), figures)


def _save(folder: Path, figures: Mapping[str, Figure]) -> list[Path]:
    from chimera_hpc.plot.style import save

    # The warnings are of letters that the font lacks.
    with errors_in_one_line(folder), warnings.catch_warnings(action="ignore"):
        folder.mkdir(parents=True, exist_ok=True)
        return [save(figure, folder / name)[0] for name, figure in figures.items()]


def table(made: Collection, judge: Judge | None) -> Iterator[str]:
    """Yield a line for each recording, warnings, and how many classes there are."""
    head = ("file", "nodes", "samples", "V_theta", "V_a", "V_Omega", "class", "confidence")
    rows = [head, *(_row(made, i) for i in range(len(made.files)))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = zip(row, widths, strict=True)
        yield "  ".join(word.ljust(width) for word, width in cells).rstrip()
    for one in made.files:
        for warning in (*one.made.warnings, *one.found.warnings):
            yield f"warning: {one.path}: {warning}"
    for warning in made.warnings:
        yield f"warning: {warning}"
    yield made.sentence if judge is None else f"classes of {judge}"


def _row(made: Collection, i: int) -> tuple[str, ...]:
    one, sure = made.files[i], made.confidence[i]
    variations = [f"{x:.4g}" if np.isfinite(x) else "-" for x in one.found.triplet]
    samples, nodes = one.made.u.shape
    confidence = f"{sure:.2f}" if np.isfinite(sure) else "-"
    name = made.names[i] or "none"
    return str(one.path), str(nodes), str(samples), *variations, name, confidence


def report_all(
    made: Collection, how: Treatment, judge: Judge | None, files: list[Path]
) -> dict[str, Any]:
    """Return what --json prints of several recordings."""
    every = zip(made.files, made.names, made.confidence.tolist(), strict=True)
    return {
        "recordings": [
            {**report(one, how, judge, []), "class": name, "confidence": _number(sure)}
            for one, name, sure in every
        ],
        "atlas": None if judge is None else str(judge.path),
        "classes": {name: made.names.count(name) for name in sorted(set(filter(None, made.names)))},
        "sentence": made.sentence or None,
        "warnings": list(made.warnings),
        "figures": [str(file) for file in files],
    }


def draw_sheet(out: Path | None, made: Collection) -> list[Path]:
    """Draw all recordings on one sheet."""
    from chimera_hpc.plot.recordings import recordings_sheet
    from chimera_hpc.plot.style import plain

    series = [(one.made.t, one.made.u.T) for one in made.files]
    titles = [plain(one.path.name) for one in made.files]
    names = [name or "none" for name in made.names]
    sheet = recordings_sheet(series, titles, names, made.triplets)
    return _save(out or Path("recordings-classified"), {"recordings": sheet})
