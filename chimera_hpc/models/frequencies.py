"""Natural frequencies of phase oscillators."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput

KINDS = ("identical", "normal", "lorentzian")


def natural_frequencies(
    size: int,
    kind: Literal["identical", "normal", "lorentzian"] = "identical",
    centre: float = 0.0,
    width: float = 1.0,
    seed: int | np.random.Generator = 0,
) -> NDArray[np.float64]:
    """Draw the natural frequencies omega of ``size`` oscillators, in radians per unit of time.

    Parameters
    ----------
    size : int
    kind : {"identical", "normal", "lorentzian"}
        All equal to ``centre``; normal with mean ``centre`` and standard deviation ``width``; or
        Lorentzian (Cauchy) with median ``centre`` and half width at half maximum ``width``.
    seed : int or Generator

    Returns
    -------
    shape (size,)

    Raises
    ------
    BadInput
        Another kind, a width below 0, or numbers that are not finite.
    """
    if kind not in KINDS:
        raise BadInput(f"frequencies: kind = {kind!r}: allowed are {', '.join(KINDS)}")
    if not (np.isfinite(centre) and np.isfinite(width) and width >= 0.0):
        raise BadInput(
            f"frequencies: centre = {centre}, width = {width}: finite numbers and width >= 0 "
            "are needed"
        )
    random = np.random.default_rng(seed)
    if kind == "identical":
        return np.full(size, float(centre))
    drawn = random.standard_normal if kind == "normal" else random.standard_cauchy
    return centre + width * drawn(size)
