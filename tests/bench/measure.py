"""How things are timed, and on what machine."""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from chimera_hpc.provenance import cpu_model

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "jax", "diffrax", "dask", "zarr")


@dataclass(frozen=True)
class Timing:
    """Wall times of one thing, seconds."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.seconds)

    @property
    def spread(self) -> float:
        """Half the range, over the median."""
        return (max(self.seconds) - min(self.seconds)) / 2 / self.median


def interleaved(
    contenders: Mapping[str, Callable[[], object]], repeats: int, at_least: float = 0.0
) -> dict[str, Timing]:
    """Time each contender once a round, so that a busy moment of the machine meets all of them.

    In its turn a contender is called again until `at_least` seconds have gone by, and their mean
    counts: a machine that changes its speed within seconds meets short and long ones alike. Each
    has run once before, unmeasured: compilation is measured elsewhere.
    """
    for run in contenders.values():
        run()
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(repeats):
        for name, run in contenders.items():
            began, calls, elapsed = time.perf_counter(), 0, -1.0
            while elapsed < at_least:
                run()
                calls += 1
                elapsed = time.perf_counter() - began
            times[name].append(elapsed / calls)
    return {name: Timing(tuple(seconds)) for name, seconds in times.items()}


def stay_on_one_core() -> None:
    """Keep this process, and whatever threads its libraries start, on one core."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def multiplication_rate(n: int = 1024, repeats: int = 60) -> float:
    """Return the floating-point operations a second of dgemm on one core: 2 n^3 over its time."""
    rng = np.random.default_rng(0)
    a, b, c = rng.random((n, n)), rng.random((n, n)), np.empty((n, n))
    timing = interleaved({"dgemm": lambda: np.matmul(a, b, out=c)}, repeats)["dgemm"]
    return 2.0 * n**3 / min(timing.seconds)


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
