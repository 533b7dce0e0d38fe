"""One recording from its file to its variations and class."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.tables import Features
from chimera_hpc.network.network import Network
from chimera_hpc.recordings.judge import (
    Judge,
    Measured,
    features_of,
    measure,
    scale_to,
    with_relative_prominence,
)
from chimera_hpc.recordings.preparing import Prepared, in_order, prepare, with_times
from chimera_hpc.recordings.read import read_recording
from chimera_hpc.recordings.recording import Choice, Recording


@dataclass(frozen=True)
class Treatment:
    """What the user says of recordings, and how they are to be measured."""

    choice: Choice = field(default_factory=Choice)
    step: float | None = None
    """Time between two samples of a file without times."""
    order: str | None = None
    span: tuple[float | None, float | None] = (None, None)
    bridge: int = 3
    scale: tuple[float, float] = (1.0, 1.0)
    rescale: bool = False
    """Whether the scale is found from the medians of the atlas."""
    lowpass: float | None = None
    ring: bool = True
    links: Path | None = None
    """File of a network, over whose links variations are taken."""
    absolute: bool = False
    """Whether the user sets ``steady_threshold``, in the unit of the signal."""

    @property
    def files(self) -> list[Path]:
        """Files that say how recordings are treated: links, and the order if it is in a file."""
        return [Path(name) for name in (self.links, self.order) if name is not None]

    def pairs(self, n_nodes: int) -> NDArray[np.int64] | None:
        """Return the pairs (M, 2) over which variations are taken; None for ring and chain."""
        if self.links is None:
            return None
        network = Network.from_file(self.links)
        if network.n_nodes != n_nodes:
            raise BadInput(
                f"--links {self.links}: a network of {network.n_nodes} nodes; the recording has "
                f"{n_nodes}"
            )
        return network.links


@dataclass(frozen=True, eq=False)
class Recorded:
    """What came out of a file."""

    path: Path
    made: Prepared
    found: Measured
    scale: tuple[float, float]


def measure_file(path: Path, how: Treatment, settings: Features, judge: Judge | None) -> Recorded:
    """Read, prepare and measure a recording, and judge it by an atlas if there is one.

    Raises BadInput, which begins with the path.
    """
    read = read_recording(path, how.choice)
    scale = how.scale
    try:
        recording = in_order(with_times(read, how.step), how.order)
        if how.rescale and judge is not None:
            raw = _prepared(recording, None, how, scale)
            relative = with_relative_prominence(raw, settings, judge)
            scale = scale_to(features_of(raw, relative), judge)
        made = _prepared(recording, None if judge is None else judge.step, how, scale)
        pairs = how.pairs(made.u.shape[1])
        found = measure(made, settings, how.ring, judge, how.absolute, pairs)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    return Recorded(path, made, found, scale)


def _prepared(recording: Recording, step: float | None, how: Treatment, scale: Any) -> Prepared:
    return prepare(
        recording, step, span=how.span, bridge=how.bridge, scale=scale, lowpass=how.lowpass
    )
