"""How well the runs of a sweep are measured: too few samples, fits that explain little, steadiness.

Limits
------
FEW_SAMPLES
    20 samples per period, see `measures.quality`. The quick start and the plane of the paper have
    20.5 (P = 24) and more.
POOR_FIT
    R^2 = 0.35: below it, a fit explains no more of the signal than of noise. White noise and noise
    below 5, 2 or 1 Hz have 0.23 to 0.26 (noise between 1 and 3 Hz 0.33), the classes of the quick
    start and of the plane 0.40 to 0.99, those of the networked model 0.60 to 0.80. Spikes have a
    low R^2 too: the line is not the whole signal (0.28 in the runs at P = 4).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Cut
from chimera_hpc.classify.naming import CLASSES
from chimera_hpc.job import Sweep
from chimera_hpc.measures.quality import FEW_SAMPLES

POOR_FIT = 0.35
POOR = "*"
"""Mark behind the name of a class whose runs are poorly fitted."""
_STILL = 1e-6
"""Standard deviation of u below which a run is steady in any unit that a signal may have."""

Columns = Mapping[str, NDArray[np.float64]]


def class_fits(cut: Cut, r_squared: ArrayLike) -> list[float]:
    """Return for each class of a cut the median R^2 of its runs; NaN where none is known."""
    values = np.asarray(r_squared, dtype=np.float64)
    return [_median(values[cut.labels == label]) for label in range(len(cut.names))]


def poor_classes(cut: Cut, r_squared: ArrayLike) -> dict[str, float]:
    """Return the classes of a cut whose median R^2 is below `POOR_FIT`, with the median."""
    fits = zip(cut.names, class_fits(cut, r_squared), strict=True)
    return {name: fit for name, fit in fits if fit < POOR_FIT}


def describe_quality(quality: Columns) -> dict[str, Any]:
    """Return what results.json holds under ``quality``: limits, medians, points below a limit."""
    entry = {}
    for name, limit in (("samples_per_period", FEW_SAMPLES), ("r_squared", POOR_FIT)):
        known = quality[name][np.isfinite(quality[name])]
        entry[name] = {
            "limit": limit,
            "points": len(known),
            "below": int(np.count_nonzero(known < limit)),
            "least": float(known.min(initial=math.inf)),
            "median": _median(known),
        }
    return entry


def quality_warnings(
    sweep: Sweep, status: ArrayLike, scalars: Columns, quality: Columns, cuts: Mapping[int, Cut]
) -> list[str]:
    """Return a line for each thing that is measured badly, with what to type."""
    step = sweep.integrator.t_step
    few = _few_samples(describe_quality(quality)["samples_per_period"], step)
    slow = _no_window(sweep, np.asarray(status), cuts)
    still = _all_steady(sweep, np.asarray(status), scalars.get("std_u"))
    level = _level_classes(np.asarray(status), cuts)
    poor: dict[str, float] = {}
    for cut in cuts.values():
        poor = {**poor_classes(cut, quality["r_squared"]), **poor}
    fits = [
        f"{name}{POOR} is poorly fitted: the sine explains {fit:.0%} of the variance of u (median "
        f"R^2 of its runs), as it does of noise (below {POOR_FIT:.0%}); look at runs with `show`"
        for name, fit in poor.items()
    ]
    return [*few, *slow, *still, *level, *fits]


def _few_samples(entry: Mapping[str, Any], step: float) -> list[str]:
    if not entry["below"]:
        return []
    enough = _round_down(step * entry["least"] / entry["limit"])
    return [
        f"{_share(entry['below'], entry['points'], 'oscillating points')} have fewer than "
        f"{entry['limit']:g} samples per period of the fastest node (as few as "
        f"{entry['least']:.3g}): their classes may be wrong; run again with "
        f"--set integrator.t_step={enough:g} and another --out"
    ]


def _no_window(sweep: Sweep, status: NDArray[Any], cuts: Mapping[int, Cut]) -> list[str]:
    count = int(np.count_nonzero(status == Status.NO_WINDOW))
    if not count:
        return []
    measured = np.isin(status, [int(code) for code in Status if code.is_result]).sum()
    slow = status == Status.NO_WINDOW
    no_class = (
        "" if any((cut.labels[slow] >= 0).any() for cut in cuts.values()) else " and no class"
    )
    return [
        f"{_share(count, int(measured), 'points')} have fewer than features.n_peaks = "
        f"{sweep.features.n_peaks} maxima{no_class}: they are too slow for the analysis, or "
        f"sampled too coarsely; run again with a larger integrator.t_end than "
        f"{sweep.integrator.t_end:g} or a smaller integrator.t_step than "
        f"{sweep.integrator.t_step:g}"
    ]


def _all_steady(sweep: Sweep, status: NDArray[Any], deviation: ArrayLike | None) -> list[str]:
    """Return a line if a limit in the unit of u made every run steady, though some vary."""
    results = np.isin(status, [int(code) for code in Status if code.is_result])
    if deviation is None or not results.any() or (status[results] != Status.STEADY).any():
        return []
    largest = float(np.nanmax(np.asarray(deviation)[results], initial=0.0))
    if largest < _STILL:
        return []
    return [
        f"all runs are steady, though u varies by up to {largest:.3g} (standard deviation): the "
        f"limit, features.steady_threshold = {sweep.features.steady_threshold:g}, has the unit of "
        f"u; if they oscillate, run again with --set features.steady_threshold="
        f"{_round_down(0.01 * largest):g} and another --out"
    ]


def _level_classes(status: NDArray[Any], cuts: Mapping[int, Cut]) -> list[str]:
    """Return a line if classes of runs at rest have names of a motion (`steady = "level"`)."""
    found = {
        name: None
        for cut in cuts.values()
        for label, (name, family) in enumerate(zip(cut.names, cut.families, strict=True))
        if family in CLASSES[1:] and not (status[cut.labels == label] == Status.DONE).any()
    }
    if not found:
        return []
    return [
        f"no run of the class {' or '.join(found)} oscillates: runs at rest are clustered by their "
        "level, and the name does not describe a motion"
    ]


def _share(count: int, of: int, what: str) -> str:
    return f"{count} of {of} {what} ({100.0 * count / of:.3g} %)"


def _round_down(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above the value."""
    power = 10.0 ** math.floor(math.log10(value))
    digit = max(d for d in (1.0, 2.0, 5.0) if d <= max(1.0, value / power))
    return float(f"{digit * power:.6g}")


def _median(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan
