"""Leading eigenvalues of the homogeneous equilibria (paper sec:stabhomeq)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from chimera_hpc.plot import style

_LOOKS = (("origin", style.RED, "o"), ("upper", style.BLUE, "s"), ("lower", style.TEAL, "x"))


@style.styled
def stability(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw (a) the largest real part against P, (b) the distance of block and full spectra.

    Each row has P, equilibrium (u*), leading_blocks, leading_jacobian and distance.
    """
    figure = style.new_figure(style.PAGE, 2.6)
    left, right = figure.subplots(1, 2)
    for name, colour, marker in _LOOKS:
        sign = {"origin": 0, "upper": 1, "lower": -1}[name]
        chosen = [r for r in rows if (r["equilibrium"] > 0) - (r["equilibrium"] < 0) == sign]
        label = {"origin": "$u^* = 0$", "upper": r"$u^* = \sqrt{3}$", "lower": r"$u^* = -\sqrt{3}$"}
        look = {"color": colour, "marker": marker, "markersize": 4.5, "linestyle": "none"}
        look |= {"fillstyle": "none" if marker == "s" else "full"}
        degrees = [r["P"] for r in chosen]
        left.plot(degrees, [r["leading_jacobian"] for r in chosen], label=label[name], **look)
        right.plot(degrees, [max(r["distance"], 1e-17) for r in chosen], **look)
    left.set_yscale("symlog", linthresh=0.01)
    left.axhline(0.0, color="#555555", linewidth=0.7)
    left.set_ylabel(r"largest $\mathrm{Re}\,\lambda$")
    right.set_yscale("log")
    right.set_ylabel(r"blocks $J_\alpha$ against full $J$")
    for axes in (left, right):
        axes.set_xlabel("$P$")
    style.letter([left, right])
    figure.legend(loc="outside upper center", ncols=3)
    return figure
