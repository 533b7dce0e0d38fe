"""``classify``: features, variations and class of a recording of one's own."""

from __future__ import annotations

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import folder_name

if TYPE_CHECKING:
    from chimera_hpc.job.tables import Features
    from chimera_hpc.recordings.judge import Judge, Measured
    from chimera_hpc.recordings.prepare import Prepared

EPILOG = """examples:
  python -m chimera_hpc.sweep classify recording.csv
  python -m chimera_hpc.sweep classify recording.npz --atlas results/quickstart
  python -m chimera_hpc.sweep classify eeg.npy --step 0.004 --open --order 3,1,0,2 --rescale \\
      --atlas results/quickstart

FILE is a time series, time by node: .npz, .npy, .csv (.tsv, .txt, .dat), .nc, or a Zarr store. With
an atlas, the reduced sweep of a similar system, it is brought to the sampling step of that sweep,
measured by its settings, and gets the class of the nearest of its runs, with the distance to it.
Variations of amplitude and frequency have units: --factors brings a recording in other units to
those of the atlas, --rescale guesses the factors from the medians. What is missing is listed; files
of pickled objects are refused.
"""
_CLOSE_UP = 12.0
_MOST_GAPS = 5


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("file", type=Path, metavar="FILE", help="the recording")
    parser.add_argument("--atlas", type=Path, metavar="STORE", help="a reduced sweep's folder")
    reading = parser.add_argument_group("what is what in the file")
    reading.add_argument("--variable", metavar="NAME", help="array or variable of the signals")
    reading.add_argument("--time", metavar="NAME", help="column, array or dimension of the times")
    reading.add_argument("--step", type=float, metavar="X", help="time between two samples")
    reading.add_argument("--transpose", action="store_true", help="rows are nodes")
    reading.add_argument(
        "--select",
        action="append",
        default=[],
        metavar="NAME=INDEX",
        help="what to take along another dimension (NetCDF, Zarr); may be repeated",
    )
    nodes = parser.add_argument_group("nodes and times")
    nodes.add_argument("--open", action="store_true", help="a chain: the last node ends it")
    nodes.add_argument(
        "--order", metavar="LIST", help="nodes by name or number from 0, with commas; or a file"
    )
    nodes.add_argument("--start", type=float, metavar="T", help="first time to take")
    nodes.add_argument("--end", type=float, metavar="T", help="last time to take")
    nodes.add_argument(
        "--bridge",
        type=int,
        default=3,
        metavar="N",
        help="samples missing in a row that are interpolated (default: 3)",
    )
    nodes.add_argument(
        "--lowpass", type=float, metavar="F", help="damp frequencies above F, in the file's unit"
    )
    nodes.add_argument(
        "--factors", metavar="T,U", help="multiply times by T and signals by U: the atlas's units"
    )
    nodes.add_argument(
        "--rescale",
        action="store_true",
        help="find those factors: median frequency and amplitude become those of the atlas's runs",
    )
    nodes.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a setting of the table [features], e.g. n_peaks=5; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--out", type=folder_name, metavar="DIR", help="figures (default: FILE-classified)"
    )
    parser.add_argument("--no-figures", action="store_true", help="no figures")


def execute(args: Namespace) -> int:
    """Classify a recording."""
    if args.bridge < 0:
        raise BadInput(f"--bridge {args.bridge}: allowed is 0 or more")
    if args.rescale and args.atlas is None:
        raise BadInput("--rescale: to the units of what? --atlas STORE says it")
    from chimera_hpc.recordings.judge import Judge, measure
    from chimera_hpc.recordings.prepare import in_order, with_times
    from chimera_hpc.recordings.read import read_recording

    judge = None if args.atlas is None else Judge.load(args.atlas)
    settings = _settings(args.overrides, judge)
    recording = with_times(read_recording(args.file, _choice(args)), args.step)
    recording = in_order(recording, args.order)
    scale = _factors(args)
    if args.rescale and judge is not None:
        from chimera_hpc.recordings.judge import features_of, scale_to

        scale = scale_to(features_of(_prepare(recording, None, args, scale), settings), judge)
    made = _prepare(recording, None if judge is None else judge.step, args, scale)
    found = measure(made, settings, not args.open, judge)
    files = [] if args.no_figures else _draw(args, made, found, settings, judge)
    if args.json:
        print(json.dumps(_report(args, made, found, judge, scale, files), allow_nan=False))
    else:
        for line in _lines(args, made, found, judge, scale):
            print(line)
        for file in files:
            print(f"written: {file}")
    return Exit.COMPLETE


def _factors(args: Namespace) -> tuple[float, float]:
    if args.factors is None:
        return 1.0, 1.0
    if args.rescale:
        raise BadInput("--factors and --rescale: one of them")
    try:
        time, signal = (float(word) for word in args.factors.split(","))
    except ValueError:
        time = signal = 0.0
    if not (0.0 < time < float("inf") and 0.0 < abs(signal) < float("inf")):
        raise BadInput(f"--factors {args.factors}: T,U is needed, two numbers, T above 0")
    return time, signal


def _choice(args: Namespace) -> Any:
    from chimera_hpc.recordings.recording import Choice

    selected = []
    for word in args.select:
        name, _, index = word.partition("=")
        try:
            selected.append((name, int(index)))
        except ValueError:
            raise BadInput(f"--select {word}: NAME=INDEX is needed, INDEX from 0") from None
    no_times = args.step is not None and args.time is None
    return Choice(args.variable, args.time, tuple(selected), args.transpose, no_times)


def _settings(overrides: list[str], judge: Judge | None) -> Features:
    """Return how to measure: as the atlas was, or by default, with what the user sets."""
    from pydantic import ValidationError

    from chimera_hpc.job.reading import apply_overrides
    from chimera_hpc.job.tables import Features

    base = Features.model_validate({}) if judge is None else judge.settings
    keys = [f"features.{text.removeprefix('features.')}" for text in overrides]
    data = apply_overrides({"features": base.model_dump()}, keys)["features"]
    unknown = [name for name in data if name not in Features.model_fields]
    if unknown:
        known = ", ".join(name for name in Features.model_fields if name not in ("start", "groups"))
        raise BadInput(f"--set {unknown[0]}: no such key in [features]; known: {known}")
    try:
        return Features.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise BadInput(f"--set {'.'.join(map(str, first['loc']))}: {first['msg']}") from None


def _prepare(
    recording: Any, step: float | None, args: Namespace, scale: tuple[float, float]
) -> Prepared:
    from chimera_hpc.recordings.prepare import prepare

    span = (args.start, args.end)
    try:
        return prepare(
            recording, step, span=span, bridge=args.bridge, scale=scale, lowpass=args.lowpass
        )
    except BadInput as error:
        raise BadInput(f"{args.file}: {error}") from None


def _lines(
    args: Namespace,
    made: Prepared,
    found: Measured,
    judge: Judge | None,
    scale: tuple[float, float],
) -> Iterator[str]:
    """Yield what was found, for people."""
    shape = "chain" if args.open else "ring"
    yield f"{args.file}: {made.u.shape[1]} nodes in a {shape}, {made.t[0]:.6g} to {made.t[-1]:.6g}"
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
        yield f"  {found.samples_a_period:.3g} samples a period in the recording"
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
        yield f"class: {found.name}, by {judge.path}"
    verdict = found.verdict
    if verdict is not None:
        yield f"  distance {verdict.distance:.3g} to the nearest run: {verdict.sentence}"
        yield f"  confidence {verdict.confidence:.2f}: share of its runs as far from the next one"
        if verdict.other:
            yield f"  the nearest other class is {verdict.other}, at {verdict.other_distance:.3g}"


def _report(
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
        "confidence": None if verdict is None else verdict.confidence,
        "distance": None if verdict is None else verdict.distance,
        "other": None
        if verdict is None or not verdict.other
        else {"class": verdict.other, "distance": verdict.other_distance},
        "figures": [str(file) for file in files],
    }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _draw(
    args: Namespace,
    made: Prepared,
    found: Measured,
    settings: Features,
    judge: Judge | None,
) -> list[Path]:
    """Draw the recording, its profiles, a spectrum, and its place in the atlas."""
    from chimera_hpc.plot.indicators import fourier_indicators, profiles_of
    from chimera_hpc.plot.judged import judged
    from chimera_hpc.plot.spacetime import space_time
    from chimera_hpc.plot.spectrum import spectrum
    from chimera_hpc.plot.style import save
    from chimera_hpc.recordings.gaps import called
    from chimera_hpc.reduction.replay import window_spectrum

    title = "\n".join(filter(None, [args.file.name, (found.name or "").replace("_", " ")]))
    length = float(made.t[-1] - made.t[0])
    zoom = None
    if found.features.n_windows:
        zoom = _CLOSE_UP / float(np.median(found.features.frequency))
    zoom = zoom if zoom is not None and zoom < 0.5 * length else None
    figures = {"space_time": space_time([(made.t, made.u)], [title], zoom=zoom)}
    if found.features.n_windows:
        figures["profiles"] = fourier_indicators([profiles_of(found.features.as_array())], [title])
        node = settings.reference_node
        data, _ = window_spectrum(made.t, made.u, settings, node, 0)
        figures["spectrum"] = spectrum(data, f"{called(made.names[node])}, window 1")
    if judge is not None and found.verdict is not None:
        low, high = judge.atlas.scaler
        triplets = low + judge.atlas.points * (high - low)
        figures["atlas"] = judged(
            triplets, judge.atlas.labels, judge.atlas.names, found.triplet, found.verdict.name
        )
    folder = args.out or Path(f"{args.file.name}-classified")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return [save(figure, folder / name)[0] for name, figure in figures.items()]
    except OSError as error:
        raise BadInput(f"{folder}: can't be written: {error.strerror or error}") from None
