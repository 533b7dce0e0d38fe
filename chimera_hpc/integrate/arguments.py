"""Arguments of the stepping loop: arrays and numbers, named as in its formulas.

The loop is compiled for the types of the fields. Values are not converted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Lanes(NamedTuple):
    """The state of the lanes."""

    y: Array
    """State, (rows, lanes). A single lane has a whole number of vectors of rows."""
    y1: Array
    """State after the step, (rows, lanes)."""
    k: Array
    """Stages in order, then the error estimate: ((stages + 1) * rows, lanes)."""
    weights: Array
    """Scratch: the weights of the stages in a sample, (stages, `LANES`)."""
    lane: Array
    """Numbers of each lane, (LANE_ROWS, lanes): see `lane_rows`."""
    counters: NDArray[np.int64]
    """Counters of each lane, (COUNT_ROWS, lanes): see `lane_rows`."""
    samples: Array
    """Samples, (lanes, samples, width). Aligned to a cache line; width is a multiple of `LANES`."""


class Method(NamedTuple):
    """A Runge-Kutta pair: see `tableau.Tableau`."""

    a: Array
    e: Array
    p: Array
    order: float


class Limits(NamedTuple):
    """Tolerances, end time and step limit of the run; first sampling time and sampling step."""

    rtol: float
    atol: float
    t_end: float
    max_steps: int
    start: float
    step: float


class Step(NamedTuple):
    """The current step inside the loop. ``first`` is the offset of its first stage in ``k``.

    ``first`` is in units, and each stage has ``units`` of them. A unit is a row of eight lanes, or
    eight rows of one lane.
    """

    y: Array
    y1: Array
    k: Array
    first: int
    units: int
