"""The stepping loops, compiled in a process of their own while this one compiles the rest."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chimera_hpc.base.processes import usable_cores
from chimera_hpc.integrate.jit import cache_folder, source_digest

_COMPILE = """
import sys
sys.path[:] = {path!r}
from chimera_hpc.integrate.stepper import advance
from chimera_hpc.integrate.simd import LANES
for lanes in (1, LANES):
    advance(lanes)
"""


@contextmanager
def stepping_loops_beside() -> Iterator[None]:
    """Have the stepping loops compiled meanwhile, unless that was done before.

    They are half of all there is to compile. Whatever goes wrong beside is left to this process,
    which then finds nothing on the disk and compiles them itself.
    """
    if not _is_worth_it():
        yield
        return
    process = _start()
    try:
        yield
        process.wait()
    finally:
        process.kill()
        process.wait()


def _is_worth_it() -> bool:
    folder = Path(cache_folder())
    # A folder for this process alone, where no other can be written, is of no use to two.
    shared = folder.name == source_digest()
    return shared and usable_cores() > 1 and not any(folder.glob("*/stepper._advance_vector-*.nbc"))


def _start() -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", _COMPILE.format(path=sys.path)]
    none = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=none, stdout=none, stderr=none)
