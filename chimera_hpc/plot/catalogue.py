"""The figures of a sweep by name.

For developers: a figure is one file in this folder, with a function that takes a `FigureInput`
(and the number of clusters, where it shows one cut) and returns the figure, or None if the
sweep has no data for it. It also needs one line in `job.registry`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from matplotlib.figure import Figure

from chimera_hpc.job.registry import CUT_FIGURES, FIGURES, load
from chimera_hpc.job.selection import split_figure_name
from chimera_hpc.plot.figure_input import FigureInput

Maker = Callable[[FigureInput], Figure | None]


def choose(asked: str | Sequence[str], cuts: Sequence[int]) -> dict[str, Maker | None]:
    """Return the functions that draw the requested figures, by file name.

    "auto" requests all figures. Figures of one cut are then drawn for the first of `cuts`, and the
    composite figure for each of them. A name without a number requests every cut. The value is None
    for a figure of a cut that the sweep does not have.
    """
    if isinstance(asked, str):
        first = [f"{name}_{k}" for name in CUT_FIGURES for k in cuts[:1]]
        asked = [*FIGURES, *first, *(f"classification_{k}" for k in cuts[1:])]
    chosen: dict[str, Maker | None] = {}
    for name in asked:
        if name in FIGURES:
            chosen[name] = load(FIGURES[name])
            continue
        base, number = split_figure_name(name)
        draw = load(CUT_FIGURES[base])
        for k in cuts if number is None else [number]:
            chosen[f"{base}_{k}"] = partial(draw, n_clusters=k) if k in cuts else None
    return chosen


def is_figure_name(stem: str) -> bool:
    """Whether a file of this name, without suffix, may be one of these figures."""
    base, number = split_figure_name(stem)
    return stem in FIGURES or (number is not None and base in CUT_FIGURES)
