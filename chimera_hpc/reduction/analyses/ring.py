"""Analyses of the ring itself: drawings, equilibria, the domain of attraction, oscillation."""

from __future__ import annotations

from typing import Any

import numpy as np

from chimera_hpc.base.status import Status
from chimera_hpc.classify import stability as linear
from chimera_hpc.classify.basin import basin_map
from chimera_hpc.classify.robustness import wilson_interval
from chimera_hpc.network.topology import Topology
from chimera_hpc.reduction.analysis_input import AnalysisInput


def networks(given: AnalysisInput) -> dict[str, Any]:
    """Links of the ring of each cell (paper fig. 1, fig. 17), and of the plain ring."""
    panels = []
    for i in range(given.n_cells):
        place = given.place(i)
        ring = Topology.ring(given.sweep.n_nodes, place["P"], place["orientation"])
        ring = ring.reorient_node(0, place["Q"])
        plain = Topology.ring(given.sweep.n_nodes, place["P"])
        panels.append(
            {
                "title": f"$P$ = {place['P']}, $Q$ = {place['Q']}",
                "links": ring.links.tolist(),
                "reference": plain.links.tolist(),
                "reoriented": int(np.any(ring.links != plain.links, axis=1).sum()),
            }
        )
    return {"n_nodes": given.sweep.n_nodes, "panels": panels}


def stability(given: AnalysisInput) -> dict[str, Any]:
    """Equilibria u* = 0, +sqrt 3, -sqrt 3: leading eigenvalue, block formula against full Jacobian.

    For each cell: the residual of the equilibrium, the largest real part by the blocks and by the
    whole Jacobian, and the largest distance between both spectra.
    """
    rows, reoriented = [], []
    for i in range(given.n_cells):
        place = given.place(i)
        plain = Topology.ring(given.sweep.n_nodes, place["P"], place["orientation"])
        ring = plain.reorient_node(0, place["Q"])
        one = plain.reorient_node(0, 1)
        reoriented.append(linear.residual(one, place["b"], place["c"], float(np.sqrt(3.0))))
        for sign in (0, 1, -1):
            u = sign * np.sqrt(3.0)
            blocks = linear.predicted_spectrum(ring, place["epsilon"], place["c"], u)
            if sign >= 0:  # u* enters squared: the lower equilibrium has the Jacobian of the upper
                whole = linear.full_spectrum(ring, place["epsilon"], place["c"], u)
            rows.append(
                {
                    "P": place["P"],
                    "Q": place["Q"],
                    "equilibrium": float(u),
                    "residual": linear.residual(ring, place["b"], place["c"], u),
                    "leading_blocks": float(blocks.real.max()),
                    "leading_jacobian": float(whole.real.max()),
                    "distance": linear.spectrum_distance(blocks, whole),
                }
            )
    return {
        "rows": rows,
        "largest_distance": max(row["distance"] for row in rows),
        "largest_residual": max(row["residual"] for row in rows),
        "least_residual_reoriented": min(reoriented),
        "least_unstable": min(r["leading_jacobian"] for r in rows if r["equilibrium"] == 0.0),
        "least_stable": max(r["leading_jacobian"] for r in rows if r["equilibrium"] != 0.0),
    }


def basin(given: AnalysisInput) -> dict[str, Any]:
    """f(P, R): share of runs whose last state is inside the ball they began in (fig. 2)."""
    columns = given.points.columns
    inside = given.scalar("distance") <= columns["delta"]
    made = basin_map(columns["P"], columns["delta"], inside, given.has_result)
    return {
        "P": made.half_degree,
        "radius": made.radius,
        "fraction": made.fraction,
        "trials": made.trials,
        "safe_radius": made.safe_radius(),
        "radius_of_half": _last_above(made.radius, made.fraction, 0.5),
    }


def _last_above(radius: Any, fraction: Any, level: float) -> list[float]:
    """Largest radius at which f is still at least `level`, for each P."""
    return [
        float(radius[row >= level].max()) if (row >= level).any() else float("nan")
        for row in np.nan_to_num(fraction)
    ]


def oscillation(given: AnalysisInput) -> dict[str, Any]:
    """Runs of each cell that oscillate, move without oscillating, and rest (app. C).

    ``oscillating``: ten maxima fit into the analysis, so the Fourier method can be applied.
    ``moving``: the signal moves by more than ``features.steady_threshold``, but too slowly for
    that. The interval is Wilson's, 95 %, for the share of oscillating runs.
    """
    state = [given.status == code for code in (Status.DONE, Status.NO_WINDOW, Status.STEADY)]
    count = [np.bincount(given.cell[which], minlength=given.n_cells) for which in state]
    runs = np.sum(count, axis=0)
    low, high = wilson_interval(count[0], runs)
    cells = [
        {
            **given.place(i),
            "oscillating": int(count[0][i]),
            "moving": int(count[1][i]),
            "resting": int(count[2][i]),
            "runs": int(runs[i]),
            "low": float(low[i]),
            "high": float(high[i]),
        }
        for i in range(given.n_cells)
    ]
    return {"cells": cells, "runs": int(runs.sum()), "oscillating": int(count[0].sum())}
