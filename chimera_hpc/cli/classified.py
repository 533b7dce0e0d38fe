"""What ``classify`` says of a recording: lines, JSON, figures."""

from __future__ import annotations

import warnings
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chimera_hpc.cli.arguments import errors_in_one_line

if TYPE_CHECKING:
    from chimera_hpc.job.tables import Features
    from chimera_hpc.recordings.judge import Judge, Measured
    from chimera_hpc.recordings.prepare import Prepared

_MOST_GAPS = 5


def lines(
    args: Namespace,
    made: Prepared,
    found: Measured,
    judge: Judge | None,
    scale: tuple[float, float],
) -> Iterator[str]:
    """Yield what was found, for people."""
    shape = "chain" if args.open else "ring"
    yield f"{args.file}: {made.u.shape[1]} nodes in a {shape}, {made.t[0]:.9g} to {made.t[-1]:.9g}"
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
        yield f"class: {found.name or 'none'}, by {judge.path}"
    verdict = found.verdict
    if verdict is not None:
        yield f"  distance {verdict.distance:.3g} to the nearest run: {verdict.sentence}"
        yield f"  confidence {verdict.confidence:.2f}: share of its runs as far from the next one"
        if verdict.outside:
            yield f"  the nearest class is {verdict.name}"
        if verdict.other:
            yield f"  the nearest other class is {verdict.other}, at {verdict.other_distance:.3g}"


def report(
    args: Namespace,
    made: Prepared,
    found: Measured,
    judge: Judge | None,
    scale: tuple[float, float],
    files: list[Path],
) -> dict[str, Any]:
    """Return what --json prints."""
    verdict, features = found.verdict, found.features
    return {
        "file": str(args.file),
        "ring": not args.open,
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


def draw(
    args: Namespace, made: Prepared, found: Measured, settings: Features, judge: Judge | None
) -> list[Path]:
    """Draw the recording, its profiles, a spectrum, and its place in the atlas."""
    from chimera_hpc.plot.indicators import fourier_indicators, profiles_of, variations_text
    from chimera_hpc.plot.judged import judged
    from chimera_hpc.plot.spacetime import space_time
    from chimera_hpc.plot.spectrum import spectrum
    from chimera_hpc.plot.style import plain, save
    from chimera_hpc.recordings.gaps import called
    from chimera_hpc.reduction.replay import window_spectrum

    words = [args.file.name, (found.name or "").replace("_", " ")]
    title, names = plain("\n".join(filter(None, words))), made.names
    figures = {"space_time": space_time([(made.t, made.u.T)], [title], names=names)}
    if found.features.n_windows:
        title = f"{title}\n{variations_text(found.triplet)}"
        profiles = [profiles_of(found.features.as_array())]
        figures["profiles"] = fourier_indicators(profiles, [title], names)
        node = settings.reference_node
        data, _ = window_spectrum(made.t, made.u, settings, node, 0)
        figures["spectrum"] = spectrum(data, plain(f"{called(names[node])}, window 0"))
    if judge is not None and found.verdict is not None:
        low, high = judge.atlas.scaler
        triplets = low + judge.atlas.points * (high - low)
        figures["atlas"] = judged(
            triplets, judge.atlas.labels, judge.atlas.names, found.triplet, found.verdict.name
        )
    folder = args.out or Path(f"{args.file.name}-classified")
    # The warnings are of letters that the font lacks.
    with errors_in_one_line(folder), warnings.catch_warnings(action="ignore"):
        folder.mkdir(parents=True, exist_ok=True)
        return [save(figure, folder / name)[0] for name, figure in figures.items()]
