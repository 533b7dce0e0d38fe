"""Analyses of the Fourier method itself, and of the triplets it gives."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.fourier import measure_signals
from chimera_hpc.measures.synthetic import profile_error, synthetic_profiles, synthetic_signal
from chimera_hpc.measures.windows import maxima, windows
from chimera_hpc.reduction.analysis_input import AnalysisInput
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.reduction.selection import find_point

Array = NDArray[np.float64]
_REFINES: tuple[Literal["parabola", "sine-fit"], ...] = ("parabola", "sine-fit")
_LEVELS = (0.0, 2.5, 25.0, 50.0, 75.0, 97.5, 100.0)


def variations(given: AnalysisInput) -> dict[str, Any]:
    """Quantiles of V_theta, V_a, V_Omega and sigma_1 over the clustered runs of each cell."""
    given.need_runs()
    names = (*TRIPLET, "sigma_1")
    rows = []
    for i in range(given.n_cells):
        runs = (given.cell == i) & given.clustered
        row: dict[str, Any] = {**given.place(i), "runs": int(runs.sum())}
        for name in names if runs.any() else ():
            row[name] = np.percentile(given.scalar(name)[runs], _LEVELS)
        rows.append(row)
    return {"levels": _LEVELS, "cells": rows}


def synthetic(given: AnalysisInput) -> dict[str, Any]:
    """Known profiles against those found on [500, 1000] (fig. 11), by two ways to refine.

    Absolute time: the phase is that of the signal at t = 0, as eq. (B1) has it.
    """
    t = 500.0 + 0.01 * np.arange(50_001)
    u = synthetic_signal(t)
    truth = synthetic_profiles()._asdict()
    found, errors = {}, {}
    for refine in _REFINES:
        made = measure_signals(t, u, refine=refine, window_reference="own", time_origin="absolute")
        found[refine] = {name: getattr(made, name) for name in truth}
        errors[refine] = {
            name: float(
                np.abs(profile_error(truth[name], found[refine][name], name == "phase")).max()
            )
            for name in truth
        }
    shown = t >= 990.0
    return {
        "truth": truth,
        "found": found,
        "largest_error": errors,
        "signal": {"t": t[shown][::5], "u": np.round(u[shown][::5], 5)},
    }


def spectrum(given: AnalysisInput) -> dict[str, Any]:
    """First window of node 1 of a chimera: samples and amplitude spectrum (paper fig. 9).

    The run is the second of ``reduction.show``. The window runs from a maximum to the ninth after
    it, both ends included, without padding or taper.
    """
    given.need_runs()
    selections = given.sweep.reduction.show
    if not selections:
        raise BadInput("reduction.show names no run")
    if given.series is None:
        raise BadInput("the runs' series are needed")
    text = selections[min(1, len(selections) - 1)]
    run = find_point(given.points, text)
    if run is None:
        raise BadInput(f"{text} is not in this sweep")
    t, u = given.series(run)
    y = np.ascontiguousarray(u[:, 0])
    first, last = windows(maxima(y), given.sweep.features.n_peaks, given.sweep.features.n_overlap)
    window = slice(int(first[0]), int(last[0]) + 1)
    samples = y[window] - y[window].mean()
    amplitude = 2.0 / len(samples) * np.abs(np.fft.rfft(samples))
    frequency = np.fft.rfftfreq(len(samples), given.sweep.integrator.t_step)
    peak = int(amplitude.argmax())
    curve = np.polyfit((-1.0, 0.0, 1.0), amplitude[peak - 1 : peak + 2], 2)
    return {
        **given.points.row(run),
        "t": t[window],
        "y": y[window],
        "frequency": frequency,
        "amplitude": amplitude,
        "peak": peak,
        "n_samples": len(samples),
        "raw_frequency": float(frequency[peak]),
        "refined_offset_in_bins": float(-0.5 * curve[1] / curve[0]),
    }
