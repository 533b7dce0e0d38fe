"""Pictures of docs/method.md: what windows, clock, origin and mean do to one run.

``scripts/docs --pictures`` calls it with the folder of the quick start.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

import chimera_hpc
from chimera_hpc.measures.fourier import window_lines

matplotlib.use("agg")
from matplotlib import pyplot

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#777777"
CHIMERA, WAVE = (12, 0), (7, 0)
"""P and seed of the run whose windows are drawn, and of one with a wave around the ring."""
OWN = {"window_reference": "own", "max_windows": 4, "prominence": 0.1}
SHOWN = 14.0
"""Length of the drawn part of the analysis interval, in units of time."""
WINDOWS = ((0, "o", BLUE, "first window"), (2, "x", ORANGE, "third window"))
IMAGES = Path(__file__).resolve().parent / "images"


def series(sweep: Path, run: tuple[int, int]) -> tuple[Any, Any]:
    """Return the times (T,) and the signal u (T, N) of a run."""
    found = chimera_hpc.open(sweep)
    half_degree, seed = run
    chosen = found.isel(point=(found.P.values == half_degree) & (found.seed.values == seed))
    return found.time.values, chosen.u.values[0]


def draw_windows(t: Any, u: Any) -> Any:
    """Draw the windows of two nodes: by the clock of the ring, and on their own maxima."""
    figure, axes = pyplot.subplots(2, 1, figsize=(10, 4.4), sharex=True, layout="constrained")
    ring, own = window_lines(t, u), window_lines(t, u, **OWN)
    slowest = int(own.frequency[:, 0].argmin())
    for axis, node in zip(axes, (0, slowest), strict=True):
        axis.plot(t, u[:, node], color=GREY, linewidth=0.8)
        cases = (("maxima of node 0", ring, 0, BLUE), ("own maxima, 4 windows", own, node, ORANGE))
        for level, (name, found, row, colour) in enumerate(cases):
            for w in range(found.counts[row]):
                span = t[[found.first[row, w], found.last[row, w]]]
                height = 2.5 + 1.2 * level + 0.45 * (w % 2)
                label = name if w == 0 else None
                axis.plot(span, [height] * 2, color=colour, linewidth=4, label=label)
        axis.set_ylabel(f"u of node {node}")
        axis.set_ylim(-2.4, 4.7)
        axis.set_yticks([-2, 0, 2])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    axes[0].set_xlim(t[0], t[0] + SHOWN)
    axes[1].set_xlabel("time")
    return figure


def draw_origin(t: Any, u: Any) -> Any:
    """Draw the phase of each node in the first and the last window, by its origin."""
    cases: list[tuple[str, dict[str, Any]]] = [
        ("clock of the ring,\norigin: the window", {}),
        ("own windows,\norigin: the window", OWN),
        ("own windows,\norigin: the recording", OWN | {"time_origin": "recording"}),
        ("the same, sine fit", OWN | {"time_origin": "recording", "refine": "sine-fit"}),
    ]
    figure, axes = pyplot.subplots(1, 4, figsize=(11, 3.2), sharey=True, layout="constrained")
    for axis, (title, options) in zip(axes, cases, strict=True):
        found = window_lines(t, u, **options)
        for w, style, colour, name in WINDOWS:
            axis.plot(found.phase[:, w] / np.pi, style, color=colour, label=name, mfc="none", ms=5)
        axis.set_title(title, fontsize="medium")
        axis.set_xlabel("node")
    axes[0].set_ylabel(r"phase / $\pi$")
    axes[0].legend(loc="upper right", fontsize="small")
    return figure


def draw_means(t: Any, u: Any) -> Any:
    """Draw the phases of a wave in each window, and their circular and arithmetic means."""
    figure, axes = pyplot.subplots(1, 3, figsize=(11, 3.2), sharey=True, layout="constrained")
    lines = window_lines(t, u, **OWN, time_origin="recording", refine="sine-fit")
    for w, phase in enumerate(lines.phase.T):
        axes[0].plot(phase / np.pi, "o^sx"[w], mfc="none", ms=5, label=f"window {w}")
    axes[0].set_title("in each window", fontsize="medium")
    axes[0].set_ylabel(r"phase / $\pi$")
    axes[0].legend(loc="upper right", fontsize="small")
    means = (("circular", BLUE), ("arithmetic", ORANGE))
    for axis, (mean, colour) in zip(axes[1:], means, strict=True):
        found = chimera_hpc.fourier_features(t, u, preset="paper-printed", phase_mean=mean)
        v_theta = chimera_hpc.total_variations(found)[0]
        axis.plot(found.phase / np.pi, ".", color=colour, markersize=4)
        axis.set_title(rf"{mean} mean: $V_\theta$ = {v_theta:.3f}", fontsize="medium")
    for axis in axes:
        axis.set_xlabel("node")
    return figure


def main(sweep: Path) -> None:
    """Write the three pictures."""
    chimera, wave = series(sweep, CHIMERA), series(sweep, WAVE)
    pictures = {
        "convention-windows": draw_windows(*chimera),
        "convention-origin": draw_origin(*wave),
        "convention-mean": draw_means(*wave),
    }
    for name, figure in pictures.items():
        figure.savefig(IMAGES / f"{name}.png", dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
