"""Whether the kernels of a sweep are on the disk: a driver need not load them to find out."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path

from chimera_hpc.base.files import write_atomically
from chimera_hpc.integrate.jit import cache_folder, kernel_sources
from chimera_hpc.job import Points, Sweep
from chimera_hpc.store.provenance import PACKAGE, cpu_model

_DECIDING = ("model", "fixed", "integrator", "features", "keep")
"""Tables of a sweep that decide which kernels it needs, together with the names of its axes."""


def compile_once(sweep: Sweep, points: Points, *, load: bool) -> None:
    """Compile what the sweep's points need, unless a mark beside the kernels says that it was done.

    Parameters
    ----------
    sweep, points
        As in `task.warm_up`.
    load : bool
        Whether this process needs the kernels itself.
    """
    mark = _mark(sweep)
    # A model of the user's own may be edited at any time.
    known = ":" not in sweep.model and _holds(mark)
    if known and not load:
        return
    from chimera_hpc.run.block import warm_up

    warm_up(sweep, points)
    if not known:
        with suppress(OSError):
            write_atomically(mark, json.dumps(sorted(_kernels())).encode())


def _holds(mark: Path) -> bool:
    """Return whether the kernels that there were when the mark was written are there still."""
    try:
        return set(json.loads(mark.read_bytes())) <= set(_kernels())
    except (OSError, ValueError, TypeError):
        return False


def _kernels() -> Iterator[str]:
    for folder in os.scandir(cache_folder()):
        if folder.is_dir():
            yield from (file.name for file in os.scandir(folder) if file.name.endswith(".nbc"))


def _mark(sweep: Sweep) -> Path:
    """Return the file that says that the kernels of such sweeps are compiled.

    numba goes by place and time of the sources and by the processor; the folder stands for their
    contents, for Python's version and for numba's.
    """
    spec = sweep.to_dict()
    deciding = [spec.get(name) for name in _DECIDING]
    numbas = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    times = [file.stat().st_mtime_ns for file in kernel_sources()]
    parts = [deciding, sorted(spec["grid"]), cpu_model(), numbas, str(PACKAGE), times]
    digest = blake2b(json.dumps(parts, sort_keys=True, default=str).encode(), digest_size=8)
    return Path(cache_folder()) / f"compiled-{digest.hexdigest()}"
