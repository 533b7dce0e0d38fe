"""Natural frequencies of oscillators, given or drawn from a distribution."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.streams import generator, network_stream
from chimera_hpc.models.parameters import Parameter
from chimera_hpc.models.protocol import Row

Kind: TypeAlias = Literal["identical", "normal", "lorentzian"]
KINDS: tuple[Kind, ...] = ("identical", "normal", "lorentzian")


def natural_frequencies(
    size: int,
    kind: Kind = "identical",
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
    random = generator(seed)
    if kind == "identical":
        return np.full(size, float(centre))
    drawn = random.standard_normal if kind == "normal" else random.standard_cauchy
    return centre + width * drawn(size)


def frequency_parameters(centre: float) -> tuple[Parameter, ...]:
    """Return what a job sets of the frequencies."""
    return (
        Parameter("omega", float, centre, "Centre of the natural frequencies (rad per time)."),
        Parameter("width", float, 0.0, "Their standard deviation, or half width.", low=0.0),
        Parameter(
            "frequencies", int, 0, "0 identical, 1 normal, 2 Lorentzian, of each seed.", 0, 2
        ),
    )


def frequencies_of(row: Row, model: str, size: int) -> NDArray[np.float64]:
    """Return the natural frequencies of a point, from a stream of its model, size and seed."""
    kind = KINDS[int(row["frequencies"])]
    stream = network_stream({"frequencies_of": model, "size": size, "seed": int(row["seed"])})
    return natural_frequencies(size, kind, row["omega"], row["width"], stream)
