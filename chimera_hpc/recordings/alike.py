"""What speaks against comparing recordings with each other: copies, other rings, other units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from hashlib import blake2b

import numpy as np

from chimera_hpc.recordings.file import Recorded

_UNITS = 8.0
"""Factor between medians of recordings from which units may differ: ms and s, mm and cm."""


def copies(files: Sequence[Recorded]) -> Iterator[str]:
    """Yield a line for each oscillating recording with the values of an earlier one."""
    seen: dict[tuple[tuple[int, ...], bytes], Recorded] = {}
    for one in files:
        if one.found.features.n_windows:
            values = np.ascontiguousarray(one.made.u)
            first = seen.setdefault((values.shape, blake2b(values.data).digest()), one)
            if first is not one:
                yield f"{one.path}: the same values as {first.path}; it counts twice"


def differences(files: Sequence[Recorded]) -> Iterator[str]:
    """Yield a line for each thing but its state by which a recording may differ from the others.

    For recordings that are clustered among themselves; an atlas warns for each one by itself.
    """
    moving = [one for one in files if one.found.features.n_windows]
    if not moving:
        return
    low, high = (pick(moving, key=lambda one: one.made.u.shape[1]) for pick in (min, max))
    if low.made.u.shape[1] < high.made.u.shape[1]:
        yield (
            f"{low.made.u.shape[1]} ({low.path}) to {high.made.u.shape[1]} nodes ({high.path}): "
            "along a smooth state, neighbours differ less the more nodes there are"
        )
    for name, unit in (("frequency", "unit of frequency"), ("amplitude", "unit of the signal")):
        medians = [float(np.median(getattr(one.found.features, name))) for one in moving]
        least, most = int(np.argmin(medians)), int(np.argmax(medians))
        if medians[most] > _UNITS * medians[least]:
            variation = "V_Omega" if name == "frequency" else "V_a"
            yield (
                f"median {name} of {medians[least]:.3g} ({moving[least].path}) to "
                f"{medians[most]:.3g} ({moving[most].path}): other units? {variation} has the "
                f"{unit}; classify files of each unit by themselves"
            )
