"""The page: charts, numbers and words put into one HTML file."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.embed import file_html
from bokeh.plotting import figure
from bokeh.resources import INLINE
from jinja2 import Environment, PackageLoader, StrictUndefined

from chimera_hpc import __version__
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import write_atomically
from chimera_hpc.base.status import Status
from chimera_hpc.base.wording import number_of
from chimera_hpc.plot.style import SIGNALS, signal_label
from chimera_hpc.reduction.agreement_text import (
    CAPTION,
    cluster_lines,
    differing_line,
    differing_rows,
    matrix_rows,
    remarks,
)
from chimera_hpc.reduction.atlases import curves_beside
from chimera_hpc.reduction.audit_text import (
    HEAD,
    audit_rows,
    bootstrap_lines,
    changed_lines,
    sample_line,
)
from chimera_hpc.reduction.chains import chain_lines
from chimera_hpc.reduction.decided import decided_lines, judge_words
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.report import charts
from chimera_hpc.report.content import Content
from chimera_hpc.report.payload import Shown, axis_labels, payload
from chimera_hpc.report.pictures import MOST_CELLS, Plates, plates
from chimera_hpc.report.tree_top import top_of
from chimera_hpc.store.runs import read_run, read_work, run_numbers

REPORT = "report.html"
MOST_FAILURES = 200
"""Failed points that are listed; the command `status --failures` lists all."""
MOST_RUNS = 20
"""Runs of the command whose provenance is listed, the latest ones."""


_MOST_CHAINS = 60
"""Chains that are drawn."""


@dataclass(frozen=True)
class Report:
    """What was written."""

    path: Path
    size: int
    """Bytes."""


def write_report(
    folder: str | Path,
    *,
    most_pictures: int = MOST_CELLS,
    replay: bool = True,
    largest_tree: int | None = None,
) -> Report:
    """Write ``report.html`` into a sweep's folder, finished or not; replaces the one before.

    folder: the folder that holds store.zarr.
    most_pictures: cells that carry a picture and profiles at most.
    replay: whether runs whose series the store does not keep may be computed again for their
        pictures.
    largest_tree: points in the tree, where the last reduction's is out of date (see
        `Content.read`).

    Raises BadInput: no store in the folder.
    Raises DamagedChunk: A chunk of results that the ledger vouches for is missing or damaged.
    """
    content = Content.read(Path(folder), largest_tree)
    data = page(content, most_pictures, replay).encode()
    path = content.folder / REPORT
    write_atomically(path, data)
    return Report(path, len(data))


def page(content: Content, most_pictures: int = MOST_CELLS, replay: bool = True) -> str:
    """Return the text of the page."""
    shown = Shown.of(content)
    pictured = plates(content, shown.cells, most_pictures, replay)
    top = top_of(content.classification.linkage)
    figures = _figures(content, len(top.sizes), pictured)
    loader = PackageLoader("chimera_hpc.report")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined)
    variables = {
        "sweep": content.store.sweep,
        "counts": content.counts,
        "words": _words(content, shown, pictured.sentence),
        "data": _script_safe(payload(content, shown, pictured, top)),
        "axes": axis_labels(content),
        "judge": content.standing is not None,
        "outcomes": _outcomes(content),
        "warnings": content.results.get("warnings", []),
        "robustness_axis": _robustness_axis(content),
        "failures": _failures(content),
        "most_failures": MOST_FAILURES,
        "runs": _runs(content),
        "spec": json.dumps(content.store.sweep.to_dict(), indent=1),
        "claims": content.results.get("claims", []),
        "audit": _audit(content),
        "decided": list(decided_lines(content.results, content.axes)),
        "agreement": _agreement(content),
        "chains": chain_lines(content.results),
        "clusters": cluster_lines(content.results.get("curves", {})),
        "carrier": SIGNALS[content.store.sweep.signals],
        "names": {name: list(group) for name, group in _groups(figures).items()},
        "script": loader.get_source(environment, "report.js")[0],
        "style": loader.get_source(environment, "report.css")[0],
    }
    return file_html(
        list(figures.values()),
        INLINE,
        title=_title(content),
        template=environment.get_template("report.html"),
        template_variables=variables,
    )


def _figures(content: Content, n_branches: int, pictured: Plates) -> dict[str, figure]:
    n_nodes, signals = content.store.sweep.n_observed, content.store.sweep.signals
    along, up = (signal_label(signals, x).replace("$", "") for x in (False, pictured.ordered))
    made = charts.sources()
    height = float(content.classification.linkage[:, 2].max(initial=0.0)) or 1.0
    figures = {charts.MAP: charts.cell_map(made, axis_labels(content))}
    if n_branches:
        figures[charts.TREE] = charts.tree(made, height, n_branches)
        largest = np.nanmax(content.triplets, axis=0).tolist()
        figures |= charts.projections(made, dict(zip(TRIPLET, largest, strict=True)))
    figures[charts.PICTURE] = charts.picture(made, n_nodes, up)
    figures |= charts.profiles(made, n_nodes, along)
    if pictured.networks:
        figures[charts.NETWORK] = charts.network(made, signals)
    curves = _robustness(content)
    if curves:
        figures["robustness"] = charts.robustness(curves, _robustness_axis(content))
    if cells := content.results.get("hysteresis"):
        first, chains = cells[0], content.results["chains"][:_MOST_CHAINS]
        figures["hysteresis"] = charts.hysteresis(chains, first["along"], first["order"])
    return figures


_OTHERS = (charts.TREE, charts.NETWORK, "robustness", "hysteresis")


def _groups(figures: Mapping[str, figure]) -> dict[str, list[str]]:
    return {
        "planes": [name for name in figures if name.startswith("plane")],
        "profiles": [name for name in figures if name in charts.PROFILES],
        "others": [n for n in figures if n in _OTHERS],
    }


def _robustness(content: Content) -> dict[str, Mapping[str, Any]]:
    """Return the curves W of this sweep and of those it is drawn with, by their labels."""
    beside = content.store.sweep.reduction.beside
    others = curves_beside(content.folder, beside, lambda line: None)
    found: dict[str, Mapping[str, Any]] = {}
    for curves in (content.results.get("curves", {}), *others.values()):
        entry = curves.get("robustness")
        for each in entry.get("curves", [entry]) if entry else ():
            label = str(each.get("plain", each["label"])).replace("$", "")
            found |= {f"{label}, judged by {name}": curve for name, curve in each["by"].items()}
    return found


def _robustness_axis(content: Content) -> str:
    entry = content.results.get("curves", {}).get("robustness", {})
    return str(entry.get("axis", "reversed links Q_r"))


def _agreement(content: Content) -> dict[str, Any]:
    """Return what the page shows of the agreement between measures; empty without it."""
    entry = content.results.get("curves", {}).get("agreement")
    if not entry:
        return {}
    return {
        "caption": CAPTION,
        "matrix": matrix_rows(entry),
        "rules": entry.get("rules", {}),
        "lines": [*remarks(entry), differing_line(entry)],
        "cells": differing_rows(entry),
    }


def _audit(content: Content) -> dict[str, Any]:
    """Return what the page shows of the audit; empty without one."""
    audit = content.results.get("audit")
    if not audit:
        return {}
    return {
        "sample": sample_line(audit),
        "head": HEAD,
        "rows": audit_rows(audit),
        "changed": changed_lines(audit),
        "cells": bootstrap_lines(audit),
    }


def _title(content: Content) -> str:
    return content.store.sweep.title or content.store.sweep.name


def _words(content: Content, shown: Shown, pictures: str) -> dict[str, str]:
    counts = content.counts
    tried = counts["total"] - counts["pending"]
    n_cells, clustered = content.n_cells, int(content.cuts[content.first_cut].sizes.sum())
    kind = "" if content.store.sweep.features.steady == "level" else "oscillating "
    n_shown, n_drawn = len(shown.cells), len(shown.points)
    seeds = len(np.unique(content.store.points.columns["seed"]))
    return {
        "title": _title(content),
        "grid": "; ".join(f"{name}: {_range(labels)}" for name, labels in axis_labels(content)),
        "size": f"{number_of(counts['total'], 'point')} in {number_of(n_cells, 'cell')}, "
        f"{number_of(seeds, 'seed')}",
        "failed": number_of(counts["failed"], "point"),
        "coverage": f"{tried} of {counts['total']} points tried "
        f"({100 * tried / max(1, counts['total']):.1f} %)",
        "map": f"{n_shown} of {n_cells} cells are on the map, spread evenly."
        if n_shown < n_cells
        else "",
        "judge": _judge(content),
        "voters": f"{kind}runs",
        "projections": f"{n_drawn} of {clustered} {kind}runs, spread evenly."
        if n_drawn < clustered
        else f"All {clustered} {kind}runs.",
        "sampled": " The tree is grown over a sample; all other runs took the class of the nearest "
        "run in it."
        if content.classification.sampled
        else "",
        "pictures": pictures,
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
        "version": __version__,
        "digest": content.store.sweep.digest,
        "why": f"python -m chimera_hpc.sweep why {_place(content.folder)}",
        "status": f"python -m chimera_hpc.sweep status --failures {_place(content.folder)}",
    }


def _judge(content: Content) -> str:
    """Say which classes the map of a sweep with [decide] shows; nothing for another."""
    sweep = content.store.sweep
    if sweep.decide is None:
        return ""
    judge = judge_words(sweep)
    if content.standing is not None:
        return (
            f"These are the classes by which cells are decided, by the {judge}; a cell with an "
            "open mark is not decided. The tree of all runs may have others: choose it below."
        )
    return f"Cells are decided by the {judge}, which is not there (yet); " + (
        "the map shows the classes of the tree of all runs."
    )


def _range(labels: list[str]) -> str:
    if len(labels) <= 6:
        return ", ".join(labels)
    return f"{labels[0]} to {labels[-1]}, {len(labels)} values"


def _place(folder: Path) -> str:
    """Return the folder as a command here takes it: relative where it lies below this one."""
    path, here = folder.absolute(), Path.cwd()
    return shlex.quote(os.path.relpath(path, here) if path.is_relative_to(here) else str(path))


def _outcomes(content: Content) -> list[tuple[int, str]]:
    counts = {code: int(np.count_nonzero(content.status == code)) for code in Status}
    return [(n, code.sentence) for code, n in counts.items() if n]


def _failures(content: Content) -> list[tuple[str, str, int]]:
    """Return point, reason and tries of the failed points, as far as they are listed."""
    codes = content.status
    failed = np.flatnonzero(np.isin(codes, [int(code) for code in Status if code.is_failure]))
    tries = content.scan.columns["attempts"]
    return [
        (content.point_words(i), Status(int(codes[i])).sentence, int(tries[i]))
        for i in failed[:MOST_FAILURES].tolist()
    ]


def _runs(content: Content) -> list[dict[str, str]]:
    path = content.store.path
    numbers, counts = np.unique(content.scan.columns["run"], return_counts=True)
    points = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    listed: list[dict[str, str]] = []
    for number in run_numbers(path)[-MOST_RUNS:]:
        try:
            info = read_run(path, number)
        except BadInput as error:
            listed.append(dict.fromkeys(_RUN, "") | {"run": str(number), "note": str(error)})
            continue
        listed.append(_run(number, info, read_work(path, number), points.get(number, 0)))
    return listed


_RUN = ("run", "points", "started", "until", "where", "code", "libraries", "note")


def _run(
    number: int, info: Mapping[str, Any], work: Mapping[str, Any], n_points: int
) -> dict[str, str]:
    machine, git = _table(info, "machine"), _table(info, "git")
    package, libraries = _table(info, "package"), _table(info, "libraries")
    places = work.get("machines")
    places = places if isinstance(places, list) else []
    commit = str(git.get("commit"))[:12] + (" with changes" if git.get("dirty") else "")
    return {
        "run": str(number),
        "points": str(n_points),
        "started": str(info.get("started")),
        "until": str(work.get("until", "")),
        "where": "; ".join(map(str, places)) or f"{machine.get('host')}: {machine.get('cpu')}",
        "code": f"{package.get('name')} {package.get('version')}, source {info.get('source')}"
        + (f", commit {commit}" if git else ""),
        "libraries": f"Python {info.get('python')}, "
        + ", ".join(f"{name} {version}" for name, version in libraries.items() if version),
        "note": f"SLURM job {_table(info, 'slurm').get('SLURM_JOB_ID')}"
        if _table(info, "slurm")
        else "",
    }


def _table(info: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = info.get(key)
    return value if isinstance(value, dict) else {}


def _script_safe(data: Mapping[str, Any]) -> str:
    """Return JSON that may stand inside a script element."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")
