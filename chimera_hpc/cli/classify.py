"""``classify``: features, variations and classes of recordings of one's own."""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.base.wording import short
from chimera_hpc.cli.arguments import add, add_group, flag, path_name, value

if TYPE_CHECKING:
    from chimera_hpc.job.tables import Features
    from chimera_hpc.recordings.judge import Judge

EPILOG = """examples:
  python -m chimera_hpc.sweep classify recording.csv
  python -m chimera_hpc.sweep classify recording.npz --atlas results/quickstart
  python -m chimera_hpc.sweep classify eeg.npy --step 0.004 --open --order 3,1,0,2 --rescale \\
      --atlas results/quickstart
  python -m chimera_hpc.sweep classify recordings/*.edf --clusters auto --links network.graphml

FILE is a time series, time by node: .npz, .npy, .csv (.tsv, .txt, .dat; .gz), .mat, .h5, .edf,
.bdf, .nc, or a Zarr store. Several files, a folder of files or a pattern in quotes give one table
and one sheet of figures; without an atlas they are clustered among themselves. With an atlas (the
reduced sweep of a similar system), a recording is interpolated to the sampling step of that sweep,
measured with its settings, and gets the class of the nearest run, with the distance to it.
Variations of amplitude and frequency have units: --factors converts a recording to the units of the
atlas, --rescale estimates the factors from the medians. Missing values are listed; files with
pickled objects are refused.
"""

_NOT_SET = ("preset", "start", "groups")
"""Keys of [features] that do not say how a recording is measured, or that have a flag."""


def add_arguments(parser: ArgumentParser) -> None:
    rescale = "find those factors: median frequency and amplitude become those of the atlas's runs"
    preset = "default or paper-printed: sets several settings (default: those of the atlas)"
    setting = "a setting of the table [features], e.g. n_peaks=5; may be repeated"
    along = "what to take along another dimension (NetCDF, Zarr); may be repeated"
    what = "recordings: files, folders or patterns"
    parser.add_argument("files", nargs="+", **value("FILE", path_name, what))
    add_group(
        parser,
        "contents of the file",
        variable=value("NAME", str, "array or variable of the signals"),
        time=value("NAME", str, "column, array or dimension of the times"),
        step=value("X", float, "time between two samples"),
        transpose=flag("rows are nodes"),
        select=value("NAME=INDEX", str, along, action="append", default=[]),
    )
    add_group(
        parser,
        "nodes and times",
        open=flag("a chain instead of a ring"),
        links=value("FILE", path_name, "network: variations are taken over its links"),
        order=value("LIST", str, "nodes by name or number from 0, with commas; or a file"),
        drop=value("LIST", str, "columns to leave out, by name or number; or a file of them"),
        start=value("T", float, "first time to take"),
        end=value("T", float, "last time to take"),
        bridge=value("N", int, "missing samples in a row to interpolate (default: 3)", default=3),
        lowpass=value("F", float, "damp frequencies above F, in the file's unit"),
        factors=value("T,U", str, "multiply times by T and signals by U: the atlas's units"),
        rescale=flag(rescale),
        preset=value("NAME", str, preset),
        set=value("KEY=VALUE", str, setting, dest="overrides", action="append", default=[]),
    )
    add(
        parser,
        "--json",
        atlas=value("STORE", path_name, "a reduced sweep's folder"),
        clusters=value("N", _number_of_clusters, "cluster several files: N clusters, or auto"),
        out=value("DIR", path_name, "figures (default: FILE-classified, recordings-classified)"),
        no_figures=flag("no figures"),
    )


def execute(args: Namespace) -> int:
    if args.bridge < 0:
        raise BadInput(f"--bridge {args.bridge}: allowed is 0 or more")
    if args.rescale and args.atlas is None:
        raise BadInput("--rescale: to the units of what? --atlas STORE says it")
    if args.links is not None and args.open:
        raise BadInput("--links and --open: one of them")
    if args.clusters is not None and args.atlas is not None:
        raise BadInput("--clusters and --atlas: one of them")
    # What a model prints goes to stderr: stdout holds the answer alone.
    with redirect_stdout(sys.stderr):
        answer = _answer(args)
    for line in answer:
        # Names of files may hold bytes that are no text, and ends of lines.
        print(line.encode("utf-8", "backslashreplace").decode("utf-8").replace("\n", "\\n"))
    return Exit.COMPLETE


def _number_of_clusters(text: str) -> Any:
    if text != "auto" and not (text.isdecimal() and 0 < int(text) < 1000):
        raise ArgumentTypeError(f"{short(text)}: a number from 1 on, or auto, is needed")
    return text if text == "auto" else int(text)


def _answer(args: Namespace) -> list[str]:
    from chimera_hpc.cli.classified import draw, draw_sheet, lines, report, report_all, table
    from chimera_hpc.measures.checks import choice
    from chimera_hpc.measures.conventions import PRESETS
    from chimera_hpc.recordings.file import Treatment, measure_file
    from chimera_hpc.recordings.judge import Judge
    from chimera_hpc.recordings.many import measure_files, recording_files

    if args.preset is not None:
        choice("--preset", args.preset, tuple(PRESETS))
    judge = None if args.atlas is None else Judge.load(args.atlas, args.preset)
    settings = _settings(args.overrides, judge, args.preset)
    keys = [text.partition("=")[0].strip().removeprefix("features.") for text in args.overrides]
    how = Treatment(
        choice=_choice(args),
        step=args.step,
        order=args.order,
        span=(args.start, args.end),
        bridge=args.bridge,
        scale=_factors(args),
        rescale=args.rescale,
        lowpass=args.lowpass,
        ring=not args.open,
        links=args.links,
        absolute=not {"still", "steady_threshold"}.isdisjoint(keys),
    )
    dropped = [] if args.drop is None else [Path(args.drop)]
    sources = recording_files(args.files, [*how.files, *dropped])
    if sources.files == args.files and len(args.files) == 1 and args.clusters is None:
        one = measure_file(args.files[0], how, settings, judge)
        files = [] if args.no_figures else draw(args.out, one, settings, judge)
        if args.json:
            return [json.dumps(report(one, how, judge, files), allow_nan=False)]
        return [*lines(one, how, judge), *_written(files)]
    made = measure_files(sources, how, settings, judge, args.clusters or "auto")
    files = [] if args.no_figures else draw_sheet(args.out, made)
    if args.json:
        return [json.dumps(report_all(made, how, judge, files), allow_nan=False)]
    return [*table(made, judge), *_written(files)]


def _written(files: list[Path]) -> list[str]:
    return [f"written: {file}" for file in files]


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
    from chimera_hpc.recordings.columns import listed
    from chimera_hpc.recordings.recording import Choice

    selected = []
    for word in args.select:
        name, _, index = word.partition("=")
        try:
            selected.append((name, int(index)))
        except ValueError:
            raise BadInput(f"--select {word}: NAME=INDEX is needed, INDEX from 0") from None
    no_times = args.step is not None and args.time is None
    drop = () if args.drop is None else tuple(listed(args.drop, "--drop"))
    return Choice(args.variable, args.time, tuple(selected), args.transpose, no_times, drop)


def _settings(overrides: list[str], judge: Judge | None, preset: str | None) -> Features:
    """Return how to measure: as the atlas was, or by a preset, with what the user sets."""
    from pydantic import ValidationError

    from chimera_hpc.job.reading import apply_overrides
    from chimera_hpc.job.tables import Features

    wrong = next((text for text in overrides if "=" not in text), None)
    if wrong is not None:
        raise BadInput(f"--set {wrong}: KEY=VALUE is needed")
    default = {"preset": preset or "default"}
    base = Features.model_validate(default) if judge is None else judge.settings
    keys = [f"features.{text.removeprefix('features.')}" for text in overrides]
    data = apply_overrides({"features": base.model_dump(exclude={"preset"})}, keys)["features"]
    if "preset" in data:
        raise BadInput(f"--set preset: give it as --preset {data['preset']}")
    unknown = [name for name in data if name not in Features.model_fields]
    if unknown:
        known = ", ".join(name for name in Features.model_fields if name not in _NOT_SET)
        raise BadInput(f"--set {unknown[0]}: no such key in [features]; known: {known}")
    try:
        return Features.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise BadInput(f"--set {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
