"""Which kernels are already compiled on the disk, found without loading numba.

A file next to the compiled kernels names them. Its own name depends on all that decides which
kernels a sweep needs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.files import write_atomically
from chimera_hpc.base.processes import usable_cores
from chimera_hpc.integrate.jit import cache_folder, kernel_sources
from chimera_hpc.models.source import PACKAGE
from chimera_hpc.store.provenance import cpu_model

if TYPE_CHECKING:
    from chimera_hpc.job import Points, Sweep

_DECIDING = ("model", "fixed", "integrator", "features", "measures", "keep")
"""Tables of a sweep that decide which kernels it needs, together with the names of its axes."""


_STEPPING_LOOPS = """
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.integrate.stepper import advance
for lanes in (1, LANES):
    advance(lanes)
"""


def _say_nothing(text: str) -> None:
    """Drop a line."""


def compile_once(
    sweep: Sweep, points: Points, *, load: bool, say: Callable[[str], object] = _say_nothing
) -> None:
    """Compile the kernels that the sweep's points need, unless they are known to be on the disk.

    sweep, points: as in `block.warm_up`.
    load: whether this process needs the kernels itself.
    say: told when there is something to compile.
    """
    spec = sweep.to_dict()
    known = is_compiled(spec)
    if known and not load:
        return
    from chimera_hpc.run.block import warm_up

    if not known:
        say("compiling kernels (once, about 30 s)")
    if not known and usable_cores() > 1:
        _compile_in_two_processes(sweep, points)
    warm_up(sweep, points)
    if not known:
        with suppress(OSError):
            write_atomically(_record(spec), json.dumps(sorted(_kernels())).encode())


def _compile_in_two_processes(sweep: Sweep, points: Points) -> None:
    """Compile the stepping loops, half of all there is, in a second process meanwhile.

    Should that fail, this process finds nothing on the disk and compiles them itself.
    """
    from chimera_hpc.job.models import build
    from chimera_hpc.run.block import warm_up_features

    none = subprocess.DEVNULL
    command = [sys.executable, "-P", "-c", _STEPPING_LOOPS]
    try:
        second = subprocess.Popen(command, stdin=none, stdout=none, stderr=none)
    except OSError:
        return
    with second as process:
        try:
            warm_up_features(sweep, build(sweep, points.row(0)))
        except BaseException:
            process.kill()
            raise


def is_compiled(spec: Mapping[str, Any]) -> bool:
    """Return whether the kernels that were there after a sweep's compilation are there still.

    `spec` is what `Sweep.to_dict` returns. The right-hand side of a user's own model is not among
    them: each process compiles it for itself.
    """
    try:
        return set(json.loads(_record(spec).read_bytes())) <= set(_kernels())
    except (OSError, ValueError, TypeError):
        return False


def _kernels() -> Iterator[str]:
    for folder in os.scandir(cache_folder()):
        if folder.is_dir():
            yield from (file.name for file in os.scandir(folder) if file.name.endswith(".nbc"))


def _record(spec: Mapping[str, Any]) -> Path:
    """Return the file that names the kernels of such sweeps.

    numba's cache depends on path and time of the sources and on the processor; the folder's name on
    their contents, on Python's version and on numba's.
    """
    deciding = [spec.get(name) for name in _DECIDING]
    numbas = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    times = [file.stat().st_mtime_ns for file in kernel_sources()]
    parts = [deciding, sorted(spec["grid"]), cpu_model(), numbas, str(PACKAGE), times]
    digest = blake2b(json.dumps(parts, sort_keys=True, default=str).encode(), digest_size=8)
    return Path(cache_folder()) / f"compiled-{digest.hexdigest()}"
