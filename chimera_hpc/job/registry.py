"""The registry of what a job may name, and where it is.

A new model, method, measure, analysis or figure needs one file and one line here,
``name: "module:object"``. An object is imported at its first use.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput

if TYPE_CHECKING:
    from collections.abc import Iterable

    from chimera_hpc.integrate.tableau import Tableau
    from chimera_hpc.measures.measure import Measure

MODELS = {
    "topological_fhn": "chimera_hpc.models.topological_fhn:MODEL",
    "networked_fhn": "chimera_hpc.models.networked_fhn:MODEL",
    "kuramoto_sakaguchi": "chimera_hpc.models.kuramoto_sakaguchi:MODEL",
    "stuart_landau": "chimera_hpc.models.stuart_landau:MODEL",
    "simplicial_kuramoto": "chimera_hpc.models.simplicial_kuramoto:MODEL",
}
"""Objects with ``parameters`` and ``build``: `models.protocol.ModelKind`."""

METHODS = {
    "tsit5": "chimera_hpc.integrate.tsit5:TSIT5",
    "dopri5": "chimera_hpc.integrate.dopri5:DOPRI5",
}
"""Runge-Kutta pairs: `integrate.tableau.Tableau`."""

REMOVED_METHODS = {"verner6": "tsit5", "kcl4": "tsit5"}
"""Pairs of version 0.1 that a store may still name, and what to use instead."""

MEASURES = {
    "variations": "chimera_hpc.measures.scalars:VARIATIONS",
    "sigma": "chimera_hpc.measures.scalars:SIGMA",
    "deviation": "chimera_hpc.measures.scalars:DEVIATION",
    "range": "chimera_hpc.measures.scalars:RANGE",
    "order_parameter": "chimera_hpc.measures.scalars:ORDER_PARAMETER",
    "distance": "chimera_hpc.measures.scalars:DISTANCE",
    "local_sigma": "chimera_hpc.measures.scalars:LOCAL_SIGMA",
    "paper-printed": "chimera_hpc.measures.scalars:PAPER_PRINTED",
    "order": "chimera_hpc.measures.panel:ORDER",
    "communities": "chimera_hpc.measures.panel:COMMUNITIES",
    "g0h0": "chimera_hpc.measures.panel:CORRELATIONS",
    "phase_velocity": "chimera_hpc.measures.panel:VELOCITY",
    "centre_of_mass": "chimera_hpc.measures.panel:CENTRE_OF_MASS",
    "acm": "chimera_hpc.measures.panel:ACM",
    "fit": "chimera_hpc.measures.panel:FIT",
}
"""Measures of a run: `measures.measure.Measure`."""

OTHER_NAMES: dict[str, tuple[str, ...]] = {
    "triplet": ("variations",),
    "SI": ("range", "local_sigma"),
    "sigma_l": ("sigma",),
}
"""Names from the literature that a job's panel may hold, and the measures behind them."""

DEFAULT_PANEL = (
    "variations",
    "sigma",
    "deviation",
    "range",
    "order_parameter",
    "distance",
    "local_sigma",
)
"""Measures of a job that names none. A different default would change digests."""

ANALYSES = {
    "networks": "chimera_hpc.reduction.analyses.ring:networks",
    "stability": "chimera_hpc.reduction.analyses.ring:stability",
    "basin": "chimera_hpc.reduction.analyses.ring:basin",
    "oscillation": "chimera_hpc.reduction.analyses.ring:oscillation",
    "variations": "chimera_hpc.reduction.analyses.method:variations",
    "atlas": "chimera_hpc.reduction.analyses.judged:atlas",
    "robustness": "chimera_hpc.reduction.analyses.judged:robustness",
    "incoherence": "chimera_hpc.reduction.analyses.incoherence:incoherence",
    "sigma-l": "chimera_hpc.reduction.analyses.incoherence:sigma_l",
    "agreement": "chimera_hpc.reduction.analyses.agreement:agreement",
    "classifiers": "chimera_hpc.reduction.analyses.clusters:classifiers",
    "number-of-classes": "chimera_hpc.reduction.analyses.clusters:number_of_classes",
    "synthetic": "chimera_hpc.reduction.analyses.method:synthetic",
    "spectrum": "chimera_hpc.reduction.analyses.method:spectrum",
}
"""Functions of a `reduction.analyses.AnalysisInput` that return a dict for results.json."""

RING_ANALYSES = ("networks", "stability", "basin")
"""Those that need the paper's ring, with its P, Q and orientation."""

FIGURES = {
    "space_time": "chimera_hpc.plot.spacetime:space_time_figure",
    "indicators": "chimera_hpc.plot.indicators:indicators_figure",
    "whole_run": "chimera_hpc.plot.spacetime:whole_run_figure",
    "network_state": "chimera_hpc.plot.network_state:network_state_figure",
    "networks": "chimera_hpc.plot.network:networks_figure",
    "stability": "chimera_hpc.plot.stability:stability_figure",
    "basin": "chimera_hpc.plot.basin:basin_figure",
    "atlas": "chimera_hpc.plot.atlas:atlas_figure",
    "robustness": "chimera_hpc.plot.robustness:robustness_figure",
    "incoherence": "chimera_hpc.plot.incoherence:incoherence_figure",
    "incoherence_delta": "chimera_hpc.plot.incoherence:sensitivity_figure",
    "sigma_l": "chimera_hpc.plot.density:sigma_l_figure",
    "agreement": "chimera_hpc.plot.agreement:agreement_figure",
    "agreement_matrix": "chimera_hpc.plot.agreement:matrix_figure",
    "hysteresis": "chimera_hpc.plot.hysteresis:hysteresis_figure",
    "class_number": "chimera_hpc.plot.class_number:class_number_figure",
    "verdicts": "chimera_hpc.plot.agreement:verdicts_figure",
    "reconstruction": "chimera_hpc.plot.synthetic:reconstruction_figure",
    "synthetic_signal": "chimera_hpc.plot.synthetic:signal_figure",
    "spectrum": "chimera_hpc.plot.spectrum:spectrum_figure",
    "boundaries": "chimera_hpc.plot.boundaries:boundaries_figure",
}
"""Functions of a `plot.figure_input.FigureInput` that return a matplotlib Figure, or None if the
sweep has no data for the figure."""

CUT_FIGURES = {
    "dendrogram": "chimera_hpc.plot.dendrogram:dendrogram_figure",
    "projections": "chimera_hpc.plot.projections:projections_figure",
    "modal_classes": "chimera_hpc.plot.modes:modal_classes_figure",
    "classification": "chimera_hpc.plot.classification:classification_figure",
}
"""Figures whose function has the number of clusters as its second argument. The number may follow
the name, as in dendrogram_3."""


@cache
def load(place: str) -> Any:
    """Return the object at ``module:object``."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def method(name: str) -> Tableau:
    """Return the Runge-Kutta pair of this name. Raises BadInput: the pair was removed."""
    if name in REMOVED_METHODS:
        instead = REMOVED_METHODS[name]
        raise BadInput(f'method "{name}" was removed in version 0.2: use "{instead}"')
    found: Tableau = load(METHODS[name])
    return found


def measures(names: Iterable[str]) -> list[Measure]:
    """Return the measures of these names."""
    return [load(MEASURES[name]) for name in names]
