"""The input of an analysis."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.classification import Classification, Cut, has_triplet
from chimera_hpc.classify.modes import run_names
from chimera_hpc.classify.naming import CLASSES
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.class_names import is_papers_system
from chimera_hpc.reduction.results import TRIPLET

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AnalysisInput:
    """A finished sweep; n points in n_cells cells."""

    sweep: Sweep
    points: Points
    status: NDArray[np.int64]
    """(n,)"""
    scalars: Mapping[str, Array]
    """By name, each (n,)."""
    classification: Classification
    cut: Cut
    """The cut whose classes stand for this sweep's own."""
    atlases: Mapping[str, Atlas] = field(default_factory=dict)
    """Those of ``reduction.atlas`` by the name of their sweep, the first judges."""
    series: Callable[[int], tuple[Array, Array]] | None = None
    """Time (T,) and u (T, N) of a point by its index."""

    def scalar(self, name: str) -> Array:
        """Return one of the scalars (n,); raise BadInput if the job's measures do not have it."""
        if name not in self.scalars:
            raise BadInput(f"measures.panel has no measure that gives {name}")
        return self.scalars[name]

    @cached_property
    def triplets(self) -> Array:
        """V_theta, V_a, V_Omega, shape (n, 3)."""
        return np.stack([self.scalars[name] for name in TRIPLET], axis=1)

    @cached_property
    def clustered(self) -> NDArray[np.bool_]:
        """Whether a point has a triplet, shape (n,)."""
        return has_triplet(self.triplets, self.status)

    @cached_property
    def has_result(self) -> NDArray[np.bool_]:
        """Whether a point has a result, shape (n,)."""
        return np.isin(self.status, [code for code in Status if code.is_result])

    @cached_property
    def cell(self) -> NDArray[np.int64]:
        """Number of each point's cell, shape (n,)."""
        return self.points.cells()[0]

    @cached_property
    def cells(self) -> dict[str, NDArray[Any]]:
        """The columns but the seed, each (n_cells,)."""
        return self.points.cells()[1]

    @property
    def n_cells(self) -> int:
        return len(next(iter(self.cells.values())))

    def runs(self, cell: int) -> NDArray[np.int64]:
        """Return the points of a cell that have a result, in order."""
        return np.flatnonzero((self.cell == cell) & self.has_result)

    def place(self, cell: int) -> dict[str, Any]:
        """Return the coordinates of a cell."""
        return {name: column[cell].item() for name, column in self.cells.items()}

    def local_sigma(self) -> Array:
        """Return the local deviations sigma(m), shape (n, groups)."""
        groups = self.sweep.features.groups
        return np.stack([self.scalar(f"local_sigma_{m + 1}") for m in range(groups)], axis=1)

    def need_runs(self) -> None:
        if self.has_result.sum() < 2:
            raise BadInput("too few runs yet")

    def need_atlas(self) -> Atlas:
        """Return the atlas that judges; raise BadInput when there is none."""
        if not self.atlases:
            text = "no atlas: reduction.atlas names a sweep that has been reduced"
            raise BadInput(text)
        return next(iter(self.atlases.values()))

    @property
    def density_names(self) -> tuple[str, ...]:
        """Names of three classes of sigma_1: the paper's for its system, else none."""
        return CLASSES if is_papers_system(self.sweep) else ()

    def own_names(self) -> list[str | None]:
        """Return the class of each run by the sweep's own tree: also steady, no_window or None."""
        return run_names(self.cut.labels, self.status, self.cut.names)

    def judged_names(self, atlas: Atlas) -> list[str | None]:
        """Return the class of each run by an atlas: also steady, no_window or None."""
        labels = np.where(self.clustered, atlas.classify(self.triplets).label, -1)
        return run_names(labels, self.status, atlas.names)
