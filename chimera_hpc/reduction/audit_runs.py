"""Points of a sweep computed again in other ways: the runs of an audit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.job.tables import Integrator
from chimera_hpc.reduction.conventions import OWN, seen_under
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.schema import scalar_labels
from chimera_hpc.store.store import Store

Integers = NDArray[np.int64]

WAYS = ("tighter", "nudged", "longer")
"""At tighter tolerances; from a start that is moved a little (the control); over a longer run."""
TIGHTER, NUDGE, LONGER = 100.0, 1e-13, 5.0
_SPARE = 10
"""Factor on the limits of steps and wall time, so that none of these ways runs into them."""
_MOST_STEPS = 10**9
_PIECE = 8
"""Points that are computed together."""


Task = tuple[Path, Integers, str]


class Computed(NamedTuple):
    """The results of n runs."""

    status: Integers
    """(n,)"""
    scalars: NDArray[np.float64]
    """(n, quantities), in the order of `scalar_labels`"""
    steps: Integers
    """(n,) accepted steps"""


class Runs(NamedTuple):
    """What is compared of n runs, under one convention."""

    status: Integers
    """(n,)"""
    triplets: NDArray[np.float64]
    """(n, 3) V_theta, V_a, V_Omega"""
    distance: NDArray[np.float64]
    """(n,) distance of the last state from the centre of the initial states"""
    steps: Integers
    """(n,) accepted steps"""

    @classmethod
    def of(cls, sweep: Sweep, made: Computed, convention: str = OWN) -> Runs:
        """Pick out what labels need of the runs of a sweep."""
        scalars = dict(zip(scalar_labels(sweep), made.scalars.T, strict=True))
        known, status = seen_under(convention, sweep, scalars, made.status)
        return runs_of(status, known, made.steps)


def variant(sweep: Sweep, way: str) -> tuple[Sweep, float]:
    """Return the sweep that a way computes, and how far it moves the initial states.

    The analysis interval of a longer run is at its end and as long as the sweep's own.
    """
    spec, features = sweep.integrator, sweep.features
    limits = {
        "time_out": _SPARE * spec.time_out,
        "max_steps": min(_SPARE * spec.max_steps, _MOST_STEPS),
    }
    if way == "tighter":
        limits |= {"rtol": spec.rtol / TIGHTER, "atol": spec.atol / TIGHTER}
    if way == "longer":
        limits["t_end"] = LONGER * spec.t_end
        start = LONGER * spec.t_end - (spec.t_end - features.start)
        features = features.model_copy(update={"start": start})
    changed = {
        "integrator": spec.model_copy(update=limits),
        "features": features,
        # The type stays: what is measured is u as it would be stored.
        "keep": sweep.keep.model_copy(update={"series": "none"}),
    }
    return sweep.model_copy(update=changed), NUDGE if way == "nudged" else 0.0


def described(spec: Integrator, way: str) -> str:
    """Return a way in words, for a sweep that is integrated like this."""
    return {
        "tighter": f"tolerances / {TIGHTER:g} (rtol {spec.rtol / TIGHTER:g}, "
        f"atol {spec.atol / TIGHTER:g})",
        "nudged": f"start moved by {NUDGE:g} (control)",
        "longer": f"t_end {LONGER * spec.t_end:g} instead of {spec.t_end:g}",
    }[way]


def compute_again(
    store: Path,
    chosen: Integers,
    ways: Sequence[str],
    workers: int,
    on_piece: Callable[[int], None] = lambda done: None,
) -> dict[str, Computed]:
    """Compute points of a store once more in each of the ways.

    The results do not depend on the number of workers.

    chosen (m,): points by their numbers.
    workers: worker processes on this machine; below 2 this process computes.
    on_piece: called with the number of runs of each piece that has been done.

    Raises BadInput: A point cannot be computed, for example because a user's model has changed.
    """
    pieces = np.array_split(chosen, max(1, -(-len(chosen) // _PIECE)))
    # The longest ones first, so that no worker is left with one at the end.
    tasks = [(store, piece, way) for way in reversed(ways) for piece in pieces]
    done = list(
        _in_turn(tasks, on_piece) if workers < 2 else _side_by_side(tasks, workers, on_piece)
    )
    by_way = {
        way: [runs for (_, _, name), runs in zip(tasks, done, strict=True) if name == way]
        for way in ways
    }
    return {
        way: Computed(*(np.concatenate(columns) for columns in zip(*runs, strict=True)))
        for way, runs in by_way.items()
    }


def compute_piece(path: Path, chosen: Integers, way: str) -> Computed:
    """Compute points of a store in one of the ways, all at once."""
    from chimera_hpc.run.block import run_block

    store = Store.open(path)
    sweep, nudge = variant(store.sweep, way)
    made = run_block(sweep, store.points[chosen], nudge=nudge, starts=store.starts(chosen))
    return Computed(made.status, made.scalars, made.steps)


def runs_of(status: Integers, scalars: Mapping[str, NDArray[np.float64]], steps: Integers) -> Runs:
    """Pick out what labels need of scalars (n,) by name; the distance is NaN if it is not there."""
    triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
    return Runs(status, triplets, scalars.get("distance", np.full(len(status), np.nan)), steps)


def _in_turn(tasks: Sequence[Task], on_piece: Callable[[int], None]) -> Iterator[Computed]:
    for task in tasks:
        try:
            yield compute_piece(*task)
        except Exception as error:
            raise _trouble(task, error) from None
        on_piece(len(task[1]))


def _side_by_side(
    tasks: Sequence[Task], workers: int, on_piece: Callable[[int], None]
) -> Iterator[Computed]:
    from distributed.scheduler import KilledWorker

    from chimera_hpc.run.local_cluster import local_cluster

    with local_cluster(min(workers, len(tasks))) as client:
        # No claims count the deaths of workers here, as they do in a run.
        cluster: Any = client.cluster
        cluster.scheduler.allowed_failures = 1
        futures = [client.submit(compute_piece, *task, pure=False) for task in tasks]
        for task, future in zip(tasks, futures, strict=True):
            error = future.exception()
            if isinstance(error, KilledWorker):
                yield _lost(task)
            elif error is not None:
                raise _trouble(task, error)
            else:
                yield future.result()
            on_piece(len(task[1]))


def _trouble(task: Task, error: BaseException) -> BadInput:
    """Return what a user's model raised, or what lies about it, as one line."""
    if isinstance(error, BadInput):
        return error
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return BadInput(f"{task[0]}: points {task[1].tolist()}: {text}")


def _lost(task: Task) -> Computed:
    n, width = len(task[1]), len(scalar_labels(Store.open(task[0]).sweep))
    status = np.full(n, Status.WORKER_LOST, dtype=np.int64)
    return Computed(status, np.full((n, width), np.nan), np.zeros(n, dtype=np.int64))
