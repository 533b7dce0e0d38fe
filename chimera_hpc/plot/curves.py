"""The figures of analyses: from an entry of results.json's ``curves`` to a matplotlib figure.

For developers: a function here takes an `Outcome` and returns the figure, or None where the sweep
has not made the analysis behind it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from chimera_hpc.plot.agreement import Comparison, confusion_matrices, verdicts
from chimera_hpc.plot.atlas import Diamonds, atlas
from chimera_hpc.plot.basin import basin
from chimera_hpc.plot.density import density_classes
from chimera_hpc.plot.incoherence import Strengths, incoherence, incoherence_sensitivity
from chimera_hpc.plot.network import networks
from chimera_hpc.plot.outcome import Outcome
from chimera_hpc.plot.robustness import Band, robustness
from chimera_hpc.plot.spacetime import last_part, space_time
from chimera_hpc.plot.spectrum import Spectrum, spectrum
from chimera_hpc.plot.stability import stability
from chimera_hpc.plot.synthetic import reconstruction

_SPOKEN = {"SI": "SI", "triplets": "triplets", "sigma_1": r"$\sigma_1$"}


def _numbers(values: Any) -> Any:
    """Turn lists with None, which stands for NaN in results.json, into an array."""
    return np.array(values, dtype=np.float64)


def draw_networks(outcome: Outcome) -> Figure | None:
    """Draw the oriented rings, reoriented links in red (paper fig:orient, fig:orient:3)."""
    entry = outcome.curves.get("networks")
    if entry is None:
        return None
    panels = [(panel["title"], panel["links"]) for panel in entry["panels"]]
    return networks(panels, entry["panels"][0]["reference"], entry["n_nodes"])


def draw_stability(outcome: Outcome) -> Figure | None:
    """Draw leading eigenvalues against P (paper sec:stabhomeq)."""
    entry = outcome.curves.get("stability")
    return None if entry is None else stability(entry["rows"])


def draw_basin(outcome: Outcome) -> Figure | None:
    """Draw f(P, R) (paper fig:stability)."""
    entry = outcome.curves.get("basin")
    if entry is None:
        return None
    fraction, safe = _numbers(entry["fraction"]), _numbers(entry["safe_radius"])
    return basin(entry["P"], entry["radius"], fraction, safe)


def draw_atlas(outcome: Outcome) -> Figure | None:
    """Draw a diamond for each cell over the judge's classes (paper fig:hvsnmin:orient:1b, 1a).

    One panel for each value of the first axis, coloured by the second; with one axis, one panel
    that is coloured by it.
    """
    entry = outcome.curves.get("atlas")
    if entry is None or not outcome.axes:
        return None
    *first, (parameter, colours) = outcome.axes[:2]
    groups = [("", np.full(len(colours), True))]
    if first:
        label, values = first[0]
        each = dict.fromkeys(values.tolist())
        groups = [(f"{label.rstrip('$')} = {value}$", values == value) for value in each]
    cells = next(iter(entry["judges"].values()))
    panels = []
    for title, group in groups:
        chosen = [i for i in np.flatnonzero(group) if cells[i]["triplet"] is not None]
        triplets = _numbers([cells[i]["triplet"] for i in chosen]).reshape(-1, 3)
        panels.append(Diamonds(title, triplets, colours[chosen]))
    ground = entry["background"]
    names = ground["names"]
    return atlas(ground["triplets"], ground["labels"], names, panels, parameter=parameter)


def draw_robustness(outcome: Outcome) -> Figure | None:
    """Draw W(Q_r), with the sweeps beside this one (paper ratio-o1-o2)."""
    entries = [each["robustness"] for each in outcome.beside.values() if "robustness" in each]
    entries += [outcome.curves[name] for name in ("robustness",) if name in outcome.curves]
    bands = {}
    for entry in entries:
        curve = entry["by"][entry["judge"]]
        ends = [_numbers(curve[name]) for name in ("fraction", "low", "high")]
        bands[entry["label"]] = Band(curve["x"], *ends)
    return robustness(bands, label="reversed links $Q_r$") if bands else None


def draw_incoherence(outcome: Outcome) -> Figure | None:
    """Draw the median SI for each threshold, and the last run to show (fig:theirmeth)."""
    entry = outcome.curves.get("incoherence")
    if entry is None or not entry["deltas"] or len(outcome.axes) != 1:
        return None
    label, x = outcome.axes[0]
    panels = [
        Strengths(
            rf"$\delta$ = {made['delta']:g}", x, _numbers([row["median"] for row in made["rows"]])
        )
        for made in entry[entry["unit"]]["by_delta"]
    ]
    dynamics = None
    if outcome.shown:
        run = outcome.shown[-1]
        dynamics = last_part(run.t, run.u, run.close_up) if run.is_fast else (run.t, run.u)
    return incoherence(panels, label=label, dynamics=dynamics)


def draw_incoherence_delta(outcome: Outcome) -> Figure | None:
    """Draw the mean SI over the parameter and the threshold."""
    entry = outcome.curves.get("incoherence")
    if entry is None or len(outcome.axes) != 1:
        return None
    label, x = outcome.axes[0]
    curve = entry["range"]["curve"]
    strength = _numbers(curve["mean"])
    return incoherence_sensitivity(x, curve["delta"], strength, entry["deltas"], label=label)


def draw_sigma_l(outcome: Outcome) -> Figure | None:
    """Draw histogram and density of sigma_1 with its cuts, and its classes (paper fig:sigmal)."""
    entry = outcome.curves.get("sigma-l")
    if entry is None or len(outcome.axes) != 1:
        return None
    label, x = outcome.axes[0]
    return density_classes(
        _numbers(entry["values"]),
        entry["grid"],
        entry["density"],
        entry["cuts"],
        entry["names"],
        x[np.array(entry["cell_of_run"])],
        entry["labels"],
        label=label,
    )


def draw_agreement(outcome: Outcome) -> Figure | None:
    """Draw a confusion matrix for each pair of methods."""
    entry = outcome.curves.get("agreement")
    if entry is None:
        return None
    comparisons = [
        Comparison(_SPOKEN[p["rows"]], _SPOKEN[p["columns"]], entry["classes"], p["counts"])
        for p in entry["pairs"]
    ]
    return confusion_matrices(comparisons)


def draw_verdicts(outcome: Outcome) -> Figure | None:
    """Draw the modal class of each cell by each method, and mark where they differ."""
    entry = outcome.curves.get("agreement")
    if entry is None or len(outcome.axes) != 1:
        return None
    label, x = outcome.axes[0]
    methods: Mapping[str, Sequence[str | None]] = {
        _SPOKEN[name]: classes for name, classes in entry["modal"].items()
    }
    return verdicts(x, methods, label=label)


def draw_reconstruction(outcome: Outcome) -> Figure | None:
    """Draw known and found profiles of the synthetic signal, and the errors (paper fig:FFT)."""
    entry = outcome.curves.get("synthetic")
    return None if entry is None else reconstruction(entry["truth"], entry["found"])


def draw_synthetic_signal(outcome: Outcome) -> Figure | None:
    """Draw the synthetic signal over node and time (paper fig:reconstrsign)."""
    entry = outcome.curves.get("synthetic")
    if entry is None:
        return None
    signal = entry["signal"]
    return space_time([(signal["t"], signal["u"])], ["synthetic signal"], symbol="x_j(t)")


def draw_spectrum(outcome: Outcome) -> Figure | None:
    """Draw one window, its spectrum and the parabola (paper fig:FFTsign)."""
    entry = outcome.curves.get("spectrum")
    if entry is None:
        return None
    keys = ("t", "y", "frequency", "amplitude", "peak")
    return spectrum(Spectrum(**{key: entry[key] for key in keys}))


CURVE_FIGURES = {
    "networks": draw_networks,
    "stability": draw_stability,
    "basin": draw_basin,
    "atlas": draw_atlas,
    "robustness": draw_robustness,
    "incoherence": draw_incoherence,
    "incoherence_delta": draw_incoherence_delta,
    "sigma_l": draw_sigma_l,
    "agreement": draw_agreement,
    "verdicts": draw_verdicts,
    "reconstruction": draw_reconstruction,
    "synthetic_signal": draw_synthetic_signal,
    "spectrum": draw_spectrum,
}
