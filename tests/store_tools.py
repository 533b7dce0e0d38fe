"""A small sweep, made-up results and worker processes for the tests of the store.

Kept apart from the test files so that spawned processes can import it.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jobs_for_tests import SMALL, job_text
from numpy.typing import ArrayLike, DTypeLike, NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.store.claims import ClaimLost, claim_block
from chimera_hpc.store.schema import MISSING, SCALE, scalar_labels, series_mask
from chimera_hpc.store.store import Store

JOB = job_text(
    SMALL,
    {
        "integrator.t_end": 20.0,
        "integrator.t_step": 0.5,
        "features.start": 10.0,
        "features.n_peaks": None,
        "features.n_overlap": None,
    },
)


@dataclass
class Result:
    """What a task returns for some points."""

    status: NDArray[np.int64]
    features: NDArray[np.float64]
    scalars: NDArray[np.float64]
    quality: NDArray[np.float64]
    steps: NDArray[np.int64]
    elapsed_us: NDArray[np.int64]
    n_windows: NDArray[np.int64]
    series: NDArray[Any] | None


def small_sweep(*overrides: str) -> Sweep:
    """Return a sweep of 15 points in blocks of 4."""
    return Sweep.from_toml_text(JOB, overrides)


def results(store: Store, points: Any, status: Status = Status.DONE) -> Result:
    """Return results of points that depend on what each point is, and on nothing else."""
    sweep, columns = store.sweep, store.points.columns
    points = np.atleast_1d(points)
    features, scalars, series, quality = [], [], [], []
    for point in points:
        key = [int(columns[name][point]) for name in ("P", "Q", "seed")]
        rng = np.random.default_rng(key)
        features.append(rng.normal(size=(8, sweep.n_nodes)))
        scalars.append(rng.normal(size=len(scalar_labels(sweep))))
        series.append(rng.uniform(-3, 3, size=(sweep.n_samples, sweep.n_nodes)))
        quality.append(rng.uniform([30.0, 0.6], [50.0, 1.0]))
    n = len(points)
    u = np.array(series)
    u[~series_mask(sweep, columns["seed"][points])] = np.nan
    made = Result(
        np.full(n, status),
        np.array(features),
        np.array(scalars),
        np.array(quality),
        points * 10,
        points * 100,
        np.full(n, 3),
        None if sweep.keep.series == "none" else encode_series(u, sweep.keep.dtype),
    )
    if not status.is_result:
        made.features[:] = np.nan
        made.scalars[:] = made.quality[:] = np.nan
    return made


def block_results(store: Store, block: int, status: Status = Status.DONE) -> Result:
    """Return results of all points of a block."""
    return results(store, np.arange(*store.block(block)), status)


def fill(store: Store, run: int = 1) -> Store:
    """Write every block."""
    for block in range(store.n_blocks):
        store.write_block(block, block_results(store, block), run, 1)
    return store


def make_store(folder: Path, *overrides: str) -> Store:
    """Plan the store of the small sweep."""
    return Store.plan(folder / "store.zarr", small_sweep(*overrides))


def process_context() -> Any:
    """Return a maker of processes that start in milliseconds: a server has done the imports."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["chimera_hpc.store"])
    return context


def work(path: Path, run: int, seconds: float = 0.0, expiry: float = 60.0) -> None:
    """Do what a runner does until nothing is left: claim, compute what is missing, write."""
    store = Store.open(path)
    order = random.Random(os.getpid())
    while blocks := store.pending():
        for block in order.sample(blocks, len(blocks)):
            claim = claim_block(path, block, run, expiry=expiry)
            if claim is None:
                continue
            rows = store.points_to_do(block)
            made = results(store, store.block(block)[0] + rows) if len(rows) else None
            time.sleep(seconds)
            try:
                if made is not None:
                    store.write_block(block, made, run, claim.attempts, claim, rows)
                claim.release()
            except ClaimLost:
                continue
        time.sleep(0.002)


def plan(path: Path) -> None:
    """Plan the small store; for a process that gets killed, or loses a race."""
    Store.plan(path, small_sweep())


def claim_and_tell(path: Path, n_blocks: int, gate: Any, answers: Any) -> None:
    """Claim blocks at the same moments as others do, and tell which ones were given."""
    gate.wait()
    answers.put([block for block in range(n_blocks) if claim_block(path, block, os.getpid())])
    gate.wait()


def encode_series(u: ArrayLike, dtype: DTypeLike) -> NDArray[Any]:
    """Return a series as it is stored: float32, or int16 steps of `SCALE`.

    Samples that are NaN or beyond +-3.2767 become `MISSING` in int16.
    """
    values = np.asarray(u)
    if np.dtype(dtype) != np.int16:
        return values.astype(dtype)
    steps = np.rint(values / SCALE)
    steps[~(np.abs(steps) <= -(MISSING + 1))] = MISSING
    return steps.astype(np.int16)
