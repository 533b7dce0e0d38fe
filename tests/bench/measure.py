"""How things are timed, and on what machine."""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.store.provenance import cpu_model

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "jax", "diffrax", "dask", "zarr")


Seconds = tuple[float, ...]
"""Wall times of one thing, one a round."""


def interleaved(
    contenders: Mapping[str, Callable[[], object]], repeats: int, at_least: float = 0.0
) -> dict[str, Seconds]:
    """Time each contender in each round, so that a busy moment of the machine meets all of them.

    In a round they are called one after the other, again and again, until each has run for
    `at_least` seconds, and its mean counts: a machine that changes its speed within seconds meets
    short and long ones alike. Each has run once before, unmeasured: compilation is measured
    elsewhere.
    """
    for run in contenders.values():
        run()
    rounds = [_round(contenders, at_least) for _ in range(repeats)]
    return {name: tuple(means[name] for means in rounds) for name in contenders}


def _round(contenders: Mapping[str, Callable[[], object]], at_least: float) -> dict[str, float]:
    spent: dict[str, list[float]] = {name: [] for name in contenders}
    left = list(contenders)
    while left:
        for name in left:
            began = time.perf_counter()
            contenders[name]()
            spent[name].append(time.perf_counter() - began)
        left = [name for name in left if sum(spent[name]) < at_least]
    return {name: statistics.mean(seconds) for name, seconds in spent.items()}


def typical(spent: NDArray[np.float64]) -> list[float]:
    """Return the medians over rounds of what contenders (n, rounds) take.

    The medians are those of their shares of a round, times that of a round: a machine that is
    slower in some rounds than in others changes no ratio.
    """
    rounds = spent.sum(axis=0)
    found: list[float] = (np.median(spent / rounds, axis=1) * np.median(rounds)).tolist()
    return found


def medians(times: Mapping[str, Seconds]) -> dict[str, float]:
    """Return what each contender takes, as `typical` finds it."""
    return dict(zip(times, typical(np.array(list(times.values()))), strict=True))


def stay_on_one_core() -> None:
    """Keep this process, and whatever threads its libraries start, on one core."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def multiplication_rate(n: int = 1024, repeats: int = 60) -> float:
    """Return the floating-point operations a second of dgemm on one core: 2 n^3 over its time."""
    rng = np.random.default_rng(0)
    a, b, c = rng.random((n, n)), rng.random((n, n)), np.empty((n, n))
    timing = interleaved({"dgemm": lambda: np.matmul(a, b, out=c)}, repeats)["dgemm"]
    return 2.0 * n**3 / min(timing)


def second_cache() -> int:
    """Return the bytes of a core's second cache."""
    words = ["getconf", "LEVEL2_CACHE_SIZE"]
    return int(subprocess.run(words, capture_output=True, check=True, text=True).stdout)


def machine() -> str:
    """Describe machine and versions on one line."""
    parts = [f"{cpu_model()}, {len(os.sched_getaffinity(0))} cores", platform.system()]
    parts.append(f"Python {sys.version.split()[0]}")
    for name in PACKAGES:
        try:
            parts.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(parts)
