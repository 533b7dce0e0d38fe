"""What is missing in a recording: where, how much, and the stretch that can be analysed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from chimera_hpc.base.wording import number_of

Array = NDArray[np.float64]

_JUMP = 1.5
"""A step between two times from which samples are missing between them, in usual steps."""


_NEAR = 21
_CHANGING = 3.0


@dataclass(frozen=True)
class Gap:
    """Samples that are missing one after the other.

    `node` is None where the times themselves are missing: all nodes are.
    """

    first: float
    """Time of the last sample before the gap, or of its own first where there is none before."""
    last: float
    samples: int
    node: int | None = None

    def text(self, names: tuple[str, ...]) -> str:
        """Say it on one line."""
        who = "all nodes" if self.node is None else called(names[self.node])
        count = number_of(self.samples, "sample")
        return f"{who}: {count} missing between {self.first:.6g} and {self.last:.6g}"


def called(name: str) -> str:
    """Return how a node is called in a sentence: ``node 3``, but ``Fz``."""
    return f"node {name}" if name.isdecimal() else name


def nearby(t: Array) -> Array:
    """Return the usual step (T - 1,) around each: the median of 21, three times where it changes.

    An adaptive solver's steps grow and shrink; they are no gaps.
    """
    steps = np.diff(t)
    local = median_filter(steps, _NEAR, mode="nearest")
    changing = np.mean(np.abs(local / np.median(steps) - 1.0) > 0.5) > 0.01
    return np.asarray(local * (_CHANGING if changing else 1.0))


def find_gaps(t: Array, u: Array, step: float | Array) -> list[Gap]:
    """Return the gaps in u (T, N), longest first: times left out, and values that are NaN."""
    gaps = []
    usual = np.broadcast_to(step, len(t) - 1)
    for i in np.flatnonzero(np.diff(t) > _JUMP * usual).tolist():
        count = round((t[i + 1] - t[i]) / usual[i]) - 1
        gaps.append(Gap(float(t[i]), float(t[i + 1]), max(count, 1)))
    for node in np.flatnonzero(np.isnan(u).any(axis=0)).tolist():
        for start, stop in _runs(np.isnan(u[:, node])):
            first, last = t[max(start - 1, 0)], t[min(stop, len(t) - 1)]
            gaps.append(Gap(float(first), float(last), stop - start, node))
    return sorted(gaps, key=lambda gap: -gap.samples)


def longest_stretch(t: Array, u: Array, step: float | Array, bridge: int) -> slice:
    """Return the longest run of samples without a gap of more than `bridge` samples.

    It begins and ends with a sample at which every node has a value; empty where there is none.
    """
    bad: NDArray[np.bool_] = np.zeros(len(t), dtype=bool)
    for node in np.flatnonzero(np.isnan(u).any(axis=0)).tolist():
        for start, stop in _runs(np.isnan(u[:, node])):
            if stop - start > bridge:
                bad[start:stop] = True
    broken = np.diff(t) > (bridge + _JUMP) * step
    edges = np.flatnonzero(np.diff(bad.astype(np.int8)) != 0) + 1
    cuts = np.unique([0, *edges.tolist(), *(np.flatnonzero(broken) + 1).tolist(), len(t)])
    whole: NDArray[np.bool_] = np.asarray(np.isfinite(u).all(axis=1))
    best = slice(0, 0)
    for start, stop in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        inside = np.flatnonzero(whole[start:stop]) + start
        if bad[start] or len(inside) < 2:
            continue
        found = slice(int(inside[0]), int(inside[-1]) + 1)
        if best.stop == 0 or t[found.stop - 1] - t[found.start] > t[best.stop - 1] - t[best.start]:
            best = found
    return best


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (start, stop) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
