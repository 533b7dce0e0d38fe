"""How well a run is measured: samples per period, and how far its signals are sines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from chimera_hpc.measures.fourier import NodeFeatures

FEW_SAMPLES = 20.0
"""Samples per period below which maxima, and windows with them, are placed too coarsely."""


def quality(features: NodeFeatures, step: float) -> tuple[float, float]:
    """Return samples per period and R^2 of a run; NaN where no node oscillates.

    Samples per period are 1 / (Omega step) for the largest frequency Omega over the nodes. The
    fastest node counts, because V_Omega and V_a compare all nodes: one node that is sampled too
    coarsely moves the class of the run. R^2 is the median over the nodes of
    `NodeFeatures.r_squared`, which tells whether a sine describes the run as a whole. In a
    chimera, some nodes may not be sinusoidal. Both numbers ignore constant nodes.

    Parameters
    ----------
    features : NodeFeatures
    step : float
        Time between samples.
    """
    turning = features.amplitude > 0.0
    if not turning.any():
        return float("nan"), float("nan")
    fastest = float(features.frequency[turning].max())
    return 1.0 / (fastest * step), float(np.median(features.r_squared[turning]))
