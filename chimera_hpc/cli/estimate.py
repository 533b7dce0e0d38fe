"""What a sweep would cost, and which ones are refused without ``--yes``."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.memory import usable_memory
from chimera_hpc.base.processes import usable_cores
from chimera_hpc.base.wording import in_bytes
from chimera_hpc.cli.arguments import bytes_of
from chimera_hpc.job import Sweep, block_size
from chimera_hpc.job.blocks import point_seconds, series_bytes
from chimera_hpc.store.schema import room

MOST_FILES = 500_000
MOST_CORE_HOURS = 100_000.0
"""Beyond these a sweep is taken for a slip of the pen."""
LANES_PER_SAMPLE = 64
MOST_SIDE_BY_SIDE = 96_000_000
"""Bytes per sample of eight trajectories, and the most for which they are integrated side by side
(``SAMPLE_BYTES`` of `integrate.lanes`, which takes a second to load)."""
_PROCESS_BYTES, _POINT_BYTES, _MEASURED_BYTES = 190_000_000, 110, 24
"""Measured: a worker with its kernels; per point that it holds; per sample of a node, for u and w
of one trajectory, which are turned node by node in place, and u as it is stored."""


@dataclass(frozen=True)
class Estimate:
    """The size of a sweep."""

    points: int
    cells: int
    axes: tuple[str, ...]
    block: int
    blocks: int
    files: int
    bytes: int
    seconds: float
    """Work on one core."""
    worker_bytes: int
    """Memory of one worker, about."""
    workers: int
    """Local workers that `run` starts."""


def estimate(sweep: Sweep) -> Estimate:
    """Return what a sweep would take, computed from its points as columns."""
    points = sweep.points()
    size = block_size(sweep, len(points))
    need = room(sweep, points.columns, size)
    cells = len(points.cells()[1]["delta"])
    seconds = point_seconds(sweep) * len(points)
    return Estimate(
        *(len(points), cells, points.axes, size, need.blocks, need.files, need.bytes, seconds),
        worker_bytes=worker_bytes(sweep, len(points), size),
        workers=sweep.run.workers or usable_cores(),
    )


def worker_bytes(sweep: Sweep, n_points: int, block: int) -> int:
    """Estimate the memory of a worker, in bytes.

    These are its packages and kernels, the parameters of a block's points (of all points if they
    are not a product of axes), the series of a block that are kept, the samples of trajectories
    side by side, and the buffers in which one is measured.
    """
    samples = sweep.n_nodes * sweep.n_samples
    side_by_side = LANES_PER_SAMPLE * samples
    return int(
        _PROCESS_BYTES
        + _POINT_BYTES * (block if sweep.is_product else n_points)
        + block * series_bytes(sweep)
        + (side_by_side if side_by_side <= MOST_SIDE_BY_SIDE else 0)
        + _MEASURED_BYTES * samples
    )


def memory_lines(need: Estimate) -> list[str]:
    """Return how much memory workers take, and a warning if they exceed the machine's."""
    total = need.workers * need.worker_bytes
    words = f"about {in_bytes(need.worker_bytes)} per worker, {in_bytes(total)} for {need.workers}"
    return [f"memory      {words}", *_beyond_machine(need.worker_bytes, need.workers)]


def memory_warnings(
    sweep: Sweep, n_points: int, block: int, workers: int, size: str | None
) -> list[str]:
    """Return a warning if a worker takes more than `--mem` says, or than its share of the machine.

    workers: local ones, of which each has an equal share if `size` is None.
    """
    need = worker_bytes(sweep, n_points, block)
    if size is None:
        return _beyond_machine(need, workers)
    if bytes_of(size) >= need:
        return []
    return [f"warning: --mem {size}: a worker takes about {in_bytes(need)}; points may not fit"]


def _beyond_machine(need: int, workers: int) -> list[str]:
    """Return a warning if workers of `need` bytes each exceed the machine's memory."""
    here = usable_memory()
    if workers * need <= here:
        return []
    fit = here // need
    advice = f"--workers {fit}" if fit else "a shorter analysis interval or fewer nodes"
    return [f"warning: there are {in_bytes(here)} of memory here; run with {advice}"]


def refuse_small_memory(sweep: Sweep, size: str | None) -> None:
    """Raise BadInput when `--mem` is below half of what a worker takes."""
    if size is None:
        return
    points = sweep.points()
    need = worker_bytes(sweep, len(points), block_size(sweep, len(points)))
    if bytes_of(size) < need / 2:
        raise BadInput(
            f"--mem {size}: a worker of {sweep.name} takes about {in_bytes(need)}; "
            f"at least half of that is needed"
        )


def refuse_absurd(sweep: Sweep, need: Estimate, folder: Path, yes: bool) -> None:
    """Raise BadInput when a sweep of this size in this folder is absurd, unless `yes`."""
    reasons = _absurdities(need, folder)
    if reasons and not yes:
        raise BadInput(f"{sweep.name}: {'; '.join(reasons)}; --yes if that is meant")


def _absurdities(need: Estimate, folder: Path) -> list[str]:
    reasons = []
    if need.files > MOST_FILES:
        reasons.append(f"{need.files} files are more than {MOST_FILES} (larger blocks make fewer)")
    hours = need.seconds / 3600
    if hours > MOST_CORE_HOURS:
        reasons.append(f"{hours:.3g} core-hours are more than {MOST_CORE_HOURS:.0f}")
    free = free_bytes(folder)
    if free is not None and need.bytes > free:
        reasons.append(
            f"{in_bytes(need.bytes)} may be needed, {in_bytes(free)} are free "
            f"(keep.series = none or first-seed takes less)"
        )
    return reasons


def free_bytes(folder: Path) -> int | None:
    """Return the bytes that are free where the folder is, or would be; None when unknown."""
    for place in (folder, *folder.absolute().parents):
        if place.is_dir():
            try:
                return shutil.disk_usage(place).free
            except OSError:
                return None
    return None
