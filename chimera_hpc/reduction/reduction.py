"""The reduction of a sweep: from the store to classes, results.json, a table and figures."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.files import remove_leftovers, temporary_name, write_atomically
from chimera_hpc.classify.atlas import Atlas, Variable
from chimera_hpc.classify.classification import Classification, Cut, classify
from chimera_hpc.classify.classifiers import AGGLOMERATIVE
from chimera_hpc.classify.modes import run_names
from chimera_hpc.job.class_names import naming_rule, overridden
from chimera_hpc.reduction.agreement_text import agreement_lines, cluster_lines
from chimera_hpc.reduction.audit import Basis, Labeller, basis_of, kept_audit
from chimera_hpc.reduction.audit_runs import runs_of
from chimera_hpc.reduction.cells import FreeAxis, free_axes
from chimera_hpc.reduction.chains import chain_lines, chain_results
from chimera_hpc.reduction.conventions import OWN, conventions, seen_under
from chimera_hpc.reduction.decided import decided_lines, decided_results, standing_by, tables_of
from chimera_hpc.reduction.quality import poor_classes, quality_warnings
from chimera_hpc.reduction.record import decided_variables, reduction_variables
from chimera_hpc.reduction.results import TRIPLET, build_results, json_safe, to_json
from chimera_hpc.reduction.selection import check_selections
from chimera_hpc.reduction.stability import counted, tree_warnings
from chimera_hpc.reduction.table import DECIDED, class_table
from chimera_hpc.run.rounds import Standing
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.reduction import write_reduction
from chimera_hpc.store.schema import sample_times
from chimera_hpc.store.store import Store

if TYPE_CHECKING:
    from chimera_hpc.plot.catalogue import Maker
    from chimera_hpc.plot.figure_input import FigureInput

RESULTS, FIGURES = "results.json", "figures"
_OF_RUNS = {"space_time", "indicators", "incoherence", "network_state"}
"""Figures that show runs with their features."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Summary:
    """What a reduction made."""

    points: dict[str, int]
    """Number of points by outcome, as in results.json."""
    table: str
    """Modal classes as text."""
    store: Path
    results: Path
    figures: tuple[Path, ...]
    """PNG and PDF files."""
    notes: tuple[str, ...]
    """What could not be made, and why; a line each."""


def reduce_sweep(
    folder: str | Path,
    *,
    make_figures: bool = True,
    say: Say = lambda line: None,
    curves: Mapping[str, Any] | None = None,
    claims: Sequence[Mapping[str, Any]] = (),
) -> Summary:
    """Classify the points that are done, and write all that follows from them.

    Writes the store's group ``reduction``, results.json and the folder figures. An unfinished store
    is reduced as far as it is done; a store without an oscillating run is reduced too. After a kill
    at any moment, each file is complete, in its old or its new state, and another reduction makes
    all of them consistent. What the panel measures under another convention is reduced too (see
    `conventions`).

    Parameters
    ----------
    folder : path
        A sweep's folder, the one that holds store.zarr.
    make_figures : bool
    say : callable
        Called with each line for the user: counts, what could not be made, the table, the paths.
    curves, claims
        What else results.json is to hold under these keys.

    Raises
    ------
    BadInput
        No store in the folder, or a point to replay that the model cannot compute.
    DamagedChunk
        A chunk of results that the ledger vouches for is missing or damaged.
    """
    folder = Path(folder)
    store = Store.open(folder / STORE_NAME)
    found = conventions(store.sweep)
    for convention in reversed(found):
        if len(found) > 1:
            say(f"convention {convention or 'of the job'}:")
        work = _Work(folder, store, say, convention)
        work.classify(curves, claims)
        figures = work.draw() if make_figures and work.unwritten is None else ()
        work.tell(figures)
        if work.unwritten is not None:
            raise work.unwritten
    return Summary(
        points=work.results["points"],
        table=work.table,
        store=store.path,
        results=folder / RESULTS,
        figures=figures,
        notes=tuple(work.notes),
    )


class _Work:
    """One reduction under way."""

    def __init__(self, folder: Path, store: Store, say: Say, convention: str) -> None:
        check_selections(store.sweep, store.points)
        self.folder, self.store, self._say = folder, store, say
        self.convention, self.place = convention, folder / convention
        self.notes: list[str] = []
        self.unwritten: OSError | None = None
        ledger, self.quality = store.ledger(), store.quality()
        self.scalars, self.status = seen_under(
            convention, store.sweep, store.scalars(), ledger["status"]
        )
        self.ledger = {**ledger, "status": self.status}
        self.triplets = np.stack([self.scalars[name] for name in TRIPLET], axis=1)
        axes = [name for name in store.points.axes if name != "seed"]
        self.axes: list[FreeAxis] = free_axes(store.points.cells()[1], axes)
        self.classification: Classification
        self.results: dict[str, Any] = {}
        self.curves: dict[str, Any] = {}
        self.chains: dict[str, Any] = {}
        self.atlases: dict[str, Atlas] = {}
        self.standing: Standing | None = None
        self.decided: dict[str, Any] = {}
        self.table = ""

    def note(self, line: str) -> None:
        self.notes.append(line)
        self._say(line)

    def classify(
        self, curves: Mapping[str, Any] | None, claims: Sequence[Mapping[str, Any]]
    ) -> None:
        store, spec = self.store, self.store.sweep.reduction
        made = classify(
            self.triplets,
            self.status,
            linkage=spec.linkage,
            classifier=spec.classifier,
            cuts=spec.cuts,
            depth=spec.depth,
            names=naming_rule(store.sweep),
        )
        self.classification = made
        self.curves = {**self._analyses(), **(curves or {})}
        self.results = build_results(
            store.sweep, store.points, self.ledger, made, self.curves, claims, self.quality
        )
        measured = quality_warnings(store.sweep, self.status, self.scalars, self.quality, made.cuts)
        self.results["warnings"] = [
            *overridden(store.sweep.features),
            *counted(self.triplets, made),
            *measured,
            *tree_warnings(made),
        ]
        self.curves = self.results["curves"]
        cut = made.cuts[self.cuts[0]]
        self.standing = standing_by(store, self.status, self.triplets, self.atlases)
        self.decided = json_safe(decided_results(store, self.standing, cut, self.status))
        self.results |= self.decided
        names = run_names(cut.labels, self.status, cut.names)
        self.chains = json_safe(chain_results(store, names, self.scalars))
        self.results |= self.chains
        audit, line = kept_audit(self.place, self._basis)
        self.results |= audit
        if line:
            self.note(line)
        try:
            self._write()
        except OSError as error:
            # What was found is said all the same.
            self.unwritten = error
        self._say(_coverage(self.results["points"]))
        self._explain_missing_classes()
        r_squared = self.quality["r_squared"]
        cuts: dict[str, Cut] = {str(k): made.cuts[k] for k in self.cuts}
        if self.standing is not None:
            cuts[DECIDED] = self.standing.cut
        poor = {name: poor_classes(cut, r_squared) for name, cut in cuts.items()}
        self.table = class_table(tables_of(self.results, self.cuts), self.axes, poor)

    def _write(self) -> None:
        if self.convention == OWN:
            self.store.write_reduction(*self._variables())
        else:
            self.place.mkdir(exist_ok=True)
            write_reduction(self.place, *self._variables())
        write_atomically(self.place / RESULTS, to_json(self.results).encode())

    def _basis(self) -> Basis:
        cuts = {k: (cut.labels, cut.names) for k, cut in self.classification.cuts.items()}
        judge = Labeller.of(self.store, Atlas.of(self.classification), self.atlases)
        runs = runs_of(self.status, self.scalars, self.ledger["steps"])
        return basis_of(self.store, self.ledger, runs, cuts, judge)

    def _analyses(self) -> dict[str, Any]:
        store, spec = self.store, self.store.sweep.reduction
        if not spec.analyses and not spec.atlas:
            return {}
        from chimera_hpc.reduction.analyses import analyse
        from chimera_hpc.reduction.analysis_input import AnalysisInput
        from chimera_hpc.reduction.atlases import atlases_of

        def series(i: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            # Few analyses ask for it; what reads a run loads the kernels.
            from chimera_hpc.reduction.runs import series_of

            return sample_times(store.sweep), series_of(store, i)

        self.atlases = atlases_of(self.folder, spec.atlas, self.note, self.convention)
        given = AnalysisInput(
            sweep=store.sweep,
            points=store.points,
            status=self.status,
            scalars=self.scalars,
            classification=self.classification,
            cut=self.classification.cuts[self.cuts[0]],
            atlases=self.atlases,
            series=series,
        )
        return analyse(given, self.note)

    def _variables(self) -> tuple[dict[str, Variable], dict[str, Any]]:
        """What the store keeps: the classes, and the atlases that judged with their verdicts."""
        variables, attributes = reduction_variables(
            self.store.points, self.status, self.classification
        )
        for number, (name, atlas) in enumerate(self.atlases.items()):
            arrays, names = atlas.variables()
            judged = atlas.classify(self.triplets)
            variables |= {
                f"judge_{number}_{key}": (tuple(f"judge_{number}_{d}" for d in dimensions), values)
                for key, (dimensions, values) in arrays.items()
            }
            variables[f"judge_{number}_labels"] = (("point",), judged.label)
            variables[f"judge_{number}_distance"] = (("point",), judged.distance)
            attributes[f"judge_{number}"] = {"sweep": name, **names}
        if self.standing is not None:
            more, named = decided_variables(self.standing)
            variables, attributes = variables | more, attributes | named
        return variables, attributes

    @property
    def cuts(self) -> list[int]:
        """Numbers of clusters: as the job lists them, then that of its depth."""
        asked = [*self.store.sweep.reduction.cuts, *self.classification.cuts]
        return list(dict.fromkeys(asked))

    def _explain_missing_classes(self) -> None:
        members = len(self.classification.members)
        if members == 0:
            self.note("no run oscillates yet: there is nothing to classify")
            return
        if self.classification.classifier != AGGLOMERATIVE:
            self.note(f"classes by {self.classification.classifier}, not by the tree")
        for asked, cut in self.classification.cuts.items():
            if len(cut.names) < asked:
                self.note(f"{asked} clusters: only {len(cut.names)}, of {members} clustered runs")

    def draw(self) -> tuple[Path, ...]:
        from chimera_hpc.plot.catalogue import choose

        asked = self.store.sweep.reduction.figures
        makers = choose(asked, self.cuts)
        if self.convention != OWN:  # the features that are kept are not those of this convention
            makers = {name: make for name, make in makers.items() if name not in _OF_RUNS}
        outcome = self._outcome(makers)
        drawn: dict[str, Maker] = {}
        for name, make in makers.items():
            if make is None:
                self.note(f"figure {name}: this sweep has no such cut")
            else:
                drawn[name] = make
        made = _write_figures(self.place, drawn, outcome)
        for name in drawn if asked != "auto" else ():
            if not any(path.stem == name for path in made):
                self.note(f"figure {name}: this sweep has nothing for it to show")
        return made

    def _outcome(self, names: Mapping[str, object]) -> FigureInput:
        from chimera_hpc.plot.figure_input import FigureInput
        from chimera_hpc.reduction.atlases import curves_beside
        from chimera_hpc.reduction.runs import shown_runs, whole_runs

        store, made = self.store, self.classification
        first = made.cuts[self.cuts[0]]
        runs = run_names(first.labels, self.status, first.names)
        if (now := self.standing) is not None:
            runs = run_names(now.labels, self.status, now.judge.names)
        # Otherwise the names of the first atlas, where there is one.
        for atlas in list(self.atlases.values())[: now is None]:
            labels = np.where(first.labels >= 0, atlas.classify(self.triplets).label, -1)
            runs = run_names(labels, self.status, atlas.names)
        return FigureInput(
            classification=made,
            triplets=self.triplets,
            axes=[(axis.symbol, axis.values) for axis in self.axes],
            cells={k: self.results["cuts"][str(k)]["cells"] for k in self.cuts},
            curves=self.curves,
            decided=self.decided,
            chains=self.chains,
            kept=self._kept(),
            beside=curves_beside(
                self.folder, store.sweep.reduction.beside, self.note, self.convention
            ),
            shown=shown_runs(store, self.status, self.triplets, first, runs, self.axes, self.note)
            if _OF_RUNS & set(names)
            else (),
            whole=whole_runs(store.sweep, store.points.row(0), self.axes, self.note)
            if "whole_run" in names
            else (),
        )

    def _kept(self) -> dict[int, NDArray[np.float64]]:
        """How often each cell keeps its modal class, by cut, if there is an audit."""
        found = self.results.get("audit", {"bootstrap": {"kept": {}}})["bootstrap"]["kept"]
        return {int(k): np.array(shares, dtype=np.float64) for k, shares in found.items()}

    def tell(self, figures: Sequence[Path]) -> None:
        for line in self.table.splitlines():
            self._say(line)
        for line in decided_lines(self.decided, self.axes):
            self._say(line)
        if "agreement" in self.curves:
            for line in agreement_lines(self.curves["agreement"]):
                self._say(line)
        for line in (*chain_lines(self.results), *cluster_lines(self.curves)):
            self._say(line)
        for line in self.results["warnings"]:
            self.note(f"warning: {line}")
        self._say(f"store    {self.store.path}")
        if self.unwritten is None:
            self._say(f"results  {self.place / RESULTS}")
        if figures:
            stems = dict.fromkeys(path.stem for path in figures)
            self._say(f"figures  {self.place / FIGURES}: {', '.join(stems)} (PNG and PDF)")


def _coverage(points: Mapping[str, int]) -> str:
    total, pending = points["total"], points["pending"]
    words = {"done": "oscillate", "steady": "steady", "no_window": "without a complete window"}
    parts = [f"{points[key]} {word}" for key, word in words.items() if points[key]]
    if points["failed"]:
        parts.append(f"{points['failed']} failed")
    ran = total - pending
    return f"{ran} of {total} points run" + (f": {', '.join(parts)}" if parts else "")


def _write_figures(
    folder: Path, makers: Mapping[str, Maker], outcome: FigureInput
) -> tuple[Path, ...]:
    """Draw into a separate folder, then move each file to its place and remove older figures."""
    from chimera_hpc.plot.catalogue import is_figure_name
    from chimera_hpc.plot.style import save

    place = folder / FIGURES
    remove_leftovers(folder)
    work = temporary_name(place)
    work.mkdir()
    try:
        drawn: list[Path] = []
        for name, make in makers.items():
            figure = make(outcome)
            if figure is not None:
                drawn.extend(save(figure, work / name))
        place.mkdir(exist_ok=True)
        fresh = {path.name for path in drawn}
        for old in (*place.glob("*.png"), *place.glob("*.pdf")):
            if is_figure_name(old.stem) and old.name not in fresh:
                old.unlink()
        for path in drawn:
            os.replace(path, place / path.name)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return tuple(place / path.name for path in drawn)
