"""The input of the figures of a sweep."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.classification import Classification
from chimera_hpc.network.network import Network
from chimera_hpc.plot.raster import NodeSeries
from chimera_hpc.plot.style import drawn

Array = NDArray[np.float64]


_LINE = 26
"""Letters that fit above a panel."""


def folded(place: str) -> str:
    """Return parameters, ``P = 3, seed 1``, on as many lines as they need above a panel."""
    lines = [""]
    for part in place.split(", "):
        line = f"{lines[-1]}, {part}" if lines[-1] else part
        if len(re.sub(r"\\[a-z]+|[${}\\]", "", line)) <= _LINE:
            lines[-1] = line
        else:
            lines.append(part)
    return "\n".join(filter(None, lines))


@dataclass(frozen=True)
class DrawnRun:
    """One run to draw."""

    place: str
    """Parameters and seed."""
    t: Array
    """(T,) uniform"""
    u: NodeSeries
    """(N, T)"""
    class_name: str = ""
    features: Array | None = None
    """(8, N) in the order of `measures.fourier.FEATURES`; None where the run has none."""
    triplet: Array | None = None
    """(3,) V_theta, V_a, V_Omega; None where the run has none."""
    network: Network | None = None
    """The network of a job with a table [network], where it can be made."""
    signals: str = "nodes"
    """Where u lives: "nodes", "links" or "triangles"."""

    @property
    def title(self) -> str:
        """Place and class, each on lines that fit above a panel."""
        return "\n".join(filter(None, [folded(self.place), drawn(self.class_name)]))


@dataclass(frozen=True)
class FigureInput:
    """All that figures of a sweep are drawn from; n points in n_cells cells."""

    classification: Classification
    triplets: Array
    """(n, 3) V_theta, V_a, V_Omega"""
    axes: Sequence[tuple[str, NDArray[Any]]]
    """Parameters that vary between cells: label, and value in each cell (n_cells,)."""
    cells: Mapping[int, Sequence[Mapping[str, Any]]]
    """For each cut its cells (n_cells,) with ``class`` and ``votes``."""
    kept: Mapping[int, Array] = field(default_factory=dict)
    """For each cut, how often a cell (n_cells,) keeps its modal class; empty without an audit."""
    curves: Mapping[str, Any] = field(default_factory=dict)
    """Results of the analyses, as in results.json."""
    decided: Mapping[str, Any] = field(default_factory=dict)
    """``decide`` and ``boundaries`` of results.json; empty for a job without [decide]."""
    beside: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """``curves`` of the sweeps that are drawn with this one, by their names."""
    chains: Mapping[str, Any] = field(default_factory=dict)
    """``chains`` and ``hysteresis`` of results.json; empty for a sweep without chains."""
    shown: Sequence[DrawnRun] = ()
    """Runs over the analysis interval."""
    whole: Sequence[DrawnRun] = ()
    """Runs from t = 0 to the end."""

    @property
    def only_axis(self) -> tuple[str, NDArray[Any]] | None:
        """The axis of a sweep that has one."""
        return self.axes[0] if len(self.axes) == 1 else None

    @property
    def judged_elsewhere(self) -> str:
        """What the modal classes are by, for a sweep whose cells are decided by other classes."""
        return "by the tree of all runs" if self.decided else ""

    def classes(self, n_clusters: int) -> list[str | None]:
        """Return the modal class of each cell (n_cells,) by a cut."""
        return [cell["class"] for cell in self.cells[n_clusters]]

    def votes(self, n_clusters: int) -> list[Mapping[str, int]]:
        """Return the number of runs by class for each cell (n_cells,) by a cut."""
        return [cell["votes"] for cell in self.cells[n_clusters]]


def numbers(values: Any) -> Array:
    """Return lists with None, which stands for NaN in results.json, as an array."""
    return np.array(values, dtype=np.float64)
