"""Fourier indicators against the node: phase, amplitude, frequency (paper fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from chimera_hpc.measures.fourier import FEATURES
from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import DrawnRun, FigureInput
from chimera_hpc.plot.raster import bins


def indicators_figure(data: FigureInput) -> Figure | None:
    """Draw the Fourier indicators of the runs to show that oscillate (paper fig. 4)."""
    runs = [(run, run.features) for run in data.shown if run.features is not None]
    if not runs:
        return None
    titles = [f"{run.title}{_variations(run)}" for run, _ in runs]
    profiles = [profiles_of(features) for _, features in runs]
    return fourier_indicators(profiles, titles, signals=runs[0][0].signals)


def _variations(run: DrawnRun) -> str:
    return "" if run.triplet is None else f"\n{variations_text(run.triplet)}"


def variations_text(triplet: ArrayLike) -> str:
    """Return the three variations under their symbols."""
    values = ", ".join(f"{value:.3f}" for value in np.asarray(triplet, dtype=np.float64))
    return f"$({', '.join(SYMBOLS)})$ =\n({values})"


@dataclass(frozen=True)
class IndicatorProfiles:
    """Indicators of one run; every array is (N,)."""

    phase: ArrayLike
    amplitude: ArrayLike
    frequency: ArrayLike
    phase_std: ArrayLike
    amplitude_std: ArrayLike
    frequency_std: ArrayLike


def profiles_of(features: ArrayLike) -> IndicatorProfiles:
    """Return the profiles in features (8, N), rows as in `measures.fourier.FEATURES`."""
    rows = dict(zip(FEATURES, np.asarray(features, dtype=np.float64), strict=True))
    names = [field.name for field in fields(IndicatorProfiles)]
    return IndicatorProfiles(**{name: rows[name] for name in names})


STEPS = 400
"""Largest number of nodes that are drawn one by one. More nodes are drawn as this many steps."""
SYMBOLS = (r"V_\theta", "V_a", r"V_\Omega")
_ROWS = (
    ("phase", r"$\langle\theta_i\rangle$ (rad)"),
    ("amplitude", r"$\langle a_i\rangle$"),
    ("frequency", r"$\langle\Omega_i\rangle$ (1/time)"),
)


@style.styled
def fourier_indicators(
    runs: Sequence[IndicatorProfiles],
    titles: Sequence[str] = (),
    names: Sequence[str] = (),
    signals: str = "nodes",
) -> Figure:
    """Draw a column for each run: means as dots, one standard deviation to each side as a band.

    `names` (N,) of the nodes label their axis. The default is their numbers from 0. `signals` says
    where u lives, "nodes", "links" or "triangles".
    """
    figure = style.new_figure(max(style.COLUMN, 2.35 * len(runs)), 4.6)
    axes = figure.subplots(3, len(runs), squeeze=False, sharex="col")
    for j, run in enumerate(runs):
        for i, (name, label) in enumerate(_ROWS):
            period = 2.0 * np.pi if name == "phase" else 0.0
            _draw_profile(axes[i, j], getattr(run, name), getattr(run, f"{name}_std"), period)
            if j == 0:
                axes[i, j].set_ylabel(label)
        axes[0, j].set_ylim(-np.pi - 0.3, np.pi + 0.3)
        axes[0, j].set_yticks([-np.pi, 0.0, np.pi], [r"$-\pi$", "0", r"$\pi$"])
        axes[0, j].set_title(titles[j] if j < len(titles) else "")
        axes[2, j].set_xlabel("node" if names else style.signal_label(signals))
        if names:
            style.name_nodes(axes[2, j].xaxis, names, rotation=90)
    style.letter(list(axes[0]))
    figure.align_ylabels(axes)
    return figure


def _draw_profile(axes: Axes, mean: ArrayLike, deviation: ArrayLike, period: float) -> None:
    """Draw dots and, where the deviation is known (two windows or more), the band.

    If the quantity has a period (0: none), the band is repeated one period above and below. With
    many nodes, a few of them share one step from their smallest to their largest value: dark for
    the means, light for the band.
    """
    values = np.asarray(mean, dtype=np.float64)
    half = np.asarray(deviation, dtype=np.float64)
    starts = bins(len(values), STEPS)
    edges = np.append(starts, len(values)) - 0.5
    light = style.lighten(style.BLUE, 0.7)
    axes.use_sticky_edges = False  # else the lowest band would lie on the frame
    low, high = (np.fmin.reduceat(values - half, starts), np.fmax.reduceat(values + half, starts))
    for shift in (0.0, -period, period) if period else (0.0,):
        axes.stairs(high + shift, edges, baseline=low + shift, fill=True, color=light)
    if len(starts) == len(values):
        axes.plot(starts, values, ".", color=style.BLUE, markersize=4.0)
    else:
        low, high = np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
        axes.stairs(high, edges, baseline=low, fill=True, color=style.BLUE, linewidth=0.5)
    axes.set_xlim(-1, len(values))
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10], integer=True))
    spread = np.nanmax(values) - np.nanmin(values)
    if spread < 1e-3 * max(1.0, float(np.nanmax(np.abs(values)))):
        # Otherwise rounding errors would fill the panel and look like structure.
        centre = float(np.nanmean(values))
        reach = max(0.05 * abs(centre), 1.5 * float(np.nanmax(np.nan_to_num(half))), 1e-3)
        axes.set_ylim(centre - reach, centre + reach)
