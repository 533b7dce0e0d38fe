"""What the stepping loop takes: arrays and numbers under the names they have in its formulas.

The types of the fields are those that the loop is compiled for; nothing is converted.
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
    """Stages, one after the other, and the error estimate: ((stages + 1) * rows, lanes)."""
    weights: Array
    """Scratch: the weights of the stages in two samples, (2 * stages, `LANES`)."""
    lane: Array
    """Numbers of each lane, (LANE_ROWS, lanes): see `lane_rows`."""
    counters: NDArray[np.int64]
    """Counters of each lane, (COUNT_ROWS, lanes): see `lane_rows`."""
    samples: Array
    """Samples, (lanes, samples, width): begins a cache line; width is a multiple of `LANES`."""


class Method(NamedTuple):
    """A Runge-Kutta pair: see `tableau.Tableau`."""

    a: Array
    e: Array
    p: Array
    order: float


class Limits(NamedTuple):
    """Tolerances, end and budget of the run; first sampling time and sampling step."""

    rtol: float
    atol: float
    t_end: float
    max_steps: int
    start: float
    step: float


class Step(NamedTuple):
    """The step being made, inside the loop: ``first`` is where in ``k`` its first stage begins.

    ``first`` counts units, of which each stage has ``units``: a row of eight lanes, or eight rows
    of one lane.
    """

    y: Array
    y1: Array
    k: Array
    first: int
    units: int
