"""How often a claim holds when the seeds are drawn again: a bootstrap of whole sweeps.

The runs of every cell are drawn with replacement, as many as there are (Efron 1979,
doi:10.1214/aos/1176344552), and everything that follows from them is made again: the tree, the
atlases, the analyses, the judgement of the claim. No run is computed again.
"""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.processes import usable_cores
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.classification import Classification, classify
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.registry import ANALYSES, load
from chimera_hpc.reduction.analysis_input import AnalysisInput
from chimera_hpc.reduction.conventions import OWN, conventions, seen_under
from chimera_hpc.reduction.results import TRIPLET, build_results, json_safe
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.store import Store
from scoreboard.causes import Cause, explain
from scoreboard.claims import DEFAULT, PaperClaim, finding
from scoreboard.evidence import Evidence, Missing
from scoreboard.plan import PRINTED
from scoreboard.rules import NOT_DECIDABLE, REPRODUCED

DRAWS = 200


@dataclass(frozen=True)
class Runs:
    """What a job's store holds of its n runs."""

    sweep: Sweep
    points: Points
    status: NDArray[np.int64]
    scalars: Mapping[str, NDArray[np.float64]]

    @classmethod
    def read(cls, folder: Path, convention: str = OWN) -> Runs:
        """Read them, as a convention sees them; Missing without a store."""
        if not (folder / STORE_NAME).is_dir():
            raise Missing(f"the job {folder.name} has not been run")
        store = Store.open(folder / STORE_NAME)
        under = convention if convention in conventions(store.sweep) else OWN
        scalars, status = seen_under(under, store.sweep, store.scalars(), store.ledger()["status"])
        runs = cls(store.sweep, store.points, status, scalars)
        if max(map(len, runs.cells)) == 1:
            raise Missing(f"the job {folder.name} has one run per cell: there is nothing to draw")
        return runs

    @cached_property
    def cells(self) -> list[NDArray[np.int64]]:
        """The points of each cell."""
        cell = self.points.cells()[0]
        order = np.argsort(cell, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)

    def drawn(self, rng: np.random.Generator) -> Runs:
        """Return as many runs, those of each cell drawn from it with replacement."""
        picked = np.empty(len(self.status), dtype=np.int64)
        for cell in self.cells:
            picked[cell] = rng.choice(cell, len(cell))
        scalars = {name: values[picked] for name, values in self.scalars.items()}
        return Runs(self.sweep, self.points, self.status[picked], scalars)


class RedrawnEvidence(Evidence):
    """What the jobs would have found with other seeds: one draw of all of them."""

    def __init__(
        self, folder: str | Path, runs: dict[str, Runs], draw: int, convention: str = OWN
    ) -> None:
        super().__init__(folder, convention)
        self._runs, self._draw = runs, draw
        self._made: dict[str, tuple[Runs, Classification]] = {}

    def job(self, name: str) -> dict[str, Any]:
        """Return what results.json would hold."""
        if name not in self._known:
            runs, classes = self._redrawn(name)
            self._known[name] = self._results(runs, classes)
        return self._known[name]

    def _redrawn(self, name: str) -> tuple[Runs, Classification]:
        """Return a job's drawn runs and their classes: the same ones whichever job asks."""
        if name not in self._made:
            if name not in self._runs:
                self._runs[name] = Runs.read(self.folder / name, self.convention)
            runs = self._runs[name].drawn(np.random.default_rng([self._draw, *name.encode()]))
            spec = runs.sweep.reduction
            self._made[name] = (
                runs,
                classify(
                    np.stack([runs.scalars[each] for each in TRIPLET], axis=1),
                    runs.status,
                    linkage=spec.linkage,
                    cuts=spec.cuts,
                    depth=spec.depth,
                    names=spec.names,
                ),
            )
        return self._made[name]

    def _results(self, runs: Runs, classes: Classification) -> dict[str, Any]:
        spec = runs.sweep.reduction
        given = AnalysisInput(
            sweep=runs.sweep,
            points=runs.points,
            status=runs.status,
            scalars=runs.scalars,
            classification=classes,
            cut=next(iter(classes.cuts.values())),
            atlases={name: Atlas.of(self._redrawn(name)[1]) for name in spec.atlas},
        )
        return _Results(given)


class _Results(dict[str, Any]):
    """What results.json would hold, made when a rule first looks at it."""

    def __init__(self, given: AnalysisInput) -> None:
        super().__init__(curves=_Curves(given))
        self._given = given

    def __missing__(self, name: str) -> Any:
        made = self._given
        columns = {"status": made.status}
        self.update(build_results(made.sweep, made.points, columns, made.classification, {}) | self)
        if name not in self:
            raise KeyError(name)
        return self[name]


class _Curves(dict[str, Any]):
    """The analyses of a job, each made when a rule first looks at it."""

    def __init__(self, given: AnalysisInput) -> None:
        super().__init__()
        self._given = given

    def __missing__(self, name: str) -> Any:
        if name not in self._given.sweep.reduction.analyses:
            raise KeyError(name)
        try:
            self[name] = json_safe(load(ANALYSES[name])(self._given))
        except BadInput:
            raise KeyError(name) from None
        return self[name]


def chances(
    claims: Sequence[PaperClaim], folder: Path, convention: str, draws: range
) -> dict[str, Counter[str]]:
    """Return by the claim's id in how many of how many draws it ``holds``.

    Draws in which a claim can't be decided are not counted.
    """
    runs: dict[str, Runs] = {}
    found = {claim.id: Counter(holds=0, of=0) for claim in claims}
    for draw in draws:
        evidence = RedrawnEvidence(folder, runs, draw, convention)
        for claim in claims:
            outcome = claim.judge(evidence)
            found[claim.id]["of"] += outcome.outcome != NOT_DECIDABLE
            found[claim.id]["holds"] += outcome.outcome == REPRODUCED
    return found


def chances_by_convention(
    claims: Sequence[PaperClaim], folder: Path, draws: int
) -> dict[str, dict[str, dict[str, int]]]:
    """Return the `chances` of the claims under each convention, computed by all cores.

    A claim that is decided in no draw is left out.
    """
    names = {DEFAULT: OWN, PRINTED: PRINTED}
    cores = usable_cores()
    parts = [range(first, draws, cores) for first in range(min(cores, draws))]
    found = {name: {claim.id: Counter(holds=0, of=0) for claim in claims} for name in names}
    with ProcessPoolExecutor(cores, mp_context=multiprocessing.get_context("spawn")) as pool:
        work = {
            pool.submit(chances, claims, folder, names[name], part): name
            for name in names
            for part in parts
        }
        for done, name in work.items():
            for claim, count in done.result().items():
                found[name][claim].update(count)
    return {
        name: {claim: dict(count) for claim, count in made.items() if count["of"]}
        for name, made in found.items()
    }


def add_causes(
    rows: Sequence[dict[str, Any]],
    claims: Sequence[PaperClaim],
    folder: Path,
    causes: Mapping[str, Cause],
    draws: int,
) -> None:
    """Give each row that reproduces under no convention its ``cause``.

    Without draws, how often chance would have a claim hold is left out.
    """
    names = (DEFAULT, PRINTED)
    lost = [row for row in rows if not any(finding(row, name)["reproduced"] for name in names)]
    failed = {row["id"] for row in lost if row["reproduced"] is False}
    chosen = [claim for claim in claims if claim.id in failed] if draws else []
    counts = chances_by_convention(chosen, folder, draws)
    for row in rows:
        if row["id"] in failed:
            chance = {name: made[row["id"]] for name, made in counts.items() if row["id"] in made}
            row["cause"] = explain(row["id"], causes, chance)
