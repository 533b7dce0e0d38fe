"""Leading eigenvalues of the homogeneous equilibria (paper app. A)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput

_LOOKS = (
    (0, "$u^* = 0$", {"color": style.RED, "marker": "o"}),
    (1, r"$u^* = \sqrt{3}$", {"color": style.BLUE, "marker": "s", "fillstyle": "none"}),
    (-1, r"$u^* = -\sqrt{3}$", {"color": style.TEAL, "marker": "x"}),
)
"""Sign of u*, label and look."""


def stability_figure(data: FigureInput) -> Figure | None:
    """Draw leading eigenvalues against P (paper app. A)."""
    entry = data.curves.get("stability")
    return None if entry is None else stability(entry["rows"])


@style.styled
def stability(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw (a) the largest real part against P, (b) the distance of block and full spectra.

    Each row has P, equilibrium (u*), leading_blocks, leading_jacobian and distance.
    """
    figure, panels = style.new_panels(2, style.PAGE, 2.6)
    left, right = panels
    for sign, label, kind in _LOOKS:
        chosen = [r for r in rows if (r["equilibrium"] > 0) - (r["equilibrium"] < 0) == sign]
        look: dict[str, Any] = {"markersize": 4.5, "linestyle": "none", **kind}
        degrees = [r["P"] for r in chosen]
        left.plot(degrees, [r["leading_jacobian"] for r in chosen], label=label, **look)
        right.plot(degrees, [max(r["distance"], 1e-17) for r in chosen], **look)
    left.set_yscale("symlog", linthresh=0.01)
    left.axhline(0.0, color="#555555", linewidth=0.7)
    left.set_ylabel(r"largest $\mathrm{Re}\,\lambda$")
    right.set_yscale("log")
    right.set_ylabel(r"blocks $J_\alpha$ against full $J$")
    for axes in panels:
        axes.set_xlabel("$P$")
    style.letter(panels)
    figure.legend(loc="outside upper center", ncols=3)
    return figure
