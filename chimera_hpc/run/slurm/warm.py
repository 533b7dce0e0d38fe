"""Compile what a sweep needs, once per node: ``python -m chimera_hpc.run.slurm.warm DIR|JOB``.

A file beside the kernels tells the next job that they are there, so that it need not load them to
find out. Should they be gone all the same, each worker compiles for itself.
"""

from __future__ import annotations

import os
import platform
import sys
from contextlib import suppress
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path

from chimera_hpc.base.files import write_atomically
from chimera_hpc.store.ledger import METADATA
from chimera_hpc.store.provenance import cpu_model, package_digest

_STORE = "store.zarr"


def main(path: Path) -> None:
    """Compile the kernels of a sweep's points, unless the node has them.

    Parameters
    ----------
    path : Path
        A job file, a sweep's folder or its store.
    """
    store = path if (path / METADATA).is_file() else path / _STORE
    mark = _mark(path if path.is_file() else store / METADATA)
    if mark is not None and _holds(mark):
        return
    from chimera_hpc.integrate.jit import cache_folder
    from chimera_hpc.job import Sweep
    from chimera_hpc.run.block import warm_up
    from chimera_hpc.store.store import Store

    sweep = Sweep.load(path) if path.is_file() else Store.open(store).sweep
    warm_up(sweep, sweep.points())
    # A model of the user's own may be edited at any time, and where it lies is not known here.
    if mark is not None and ":" not in sweep.model:
        with suppress(OSError):
            write_atomically(mark, cache_folder().encode())


def _holds(mark: Path) -> bool:
    """Return whether the folder that a mark names, where the kernels are, is still there."""
    try:
        return Path(mark.read_text()).is_dir()
    except OSError:
        return False


def _mark(spec: Path) -> Path | None:
    """Return the file that says that the kernels of this spec are compiled; None: nobody knows.

    Its name depends on all that decides what is compiled: the package, Python, numba, the processor
    and the sweep.
    """
    folder = os.environ.get("NUMBA_CACHE_DIR")
    if not folder or not spec.is_file():
        return None
    digest = blake2b(spec.read_bytes(), digest_size=8)
    for part in (package_digest(), platform.python_version(), version("numba"), cpu_model()):
        digest.update(f"\0{part}".encode())
    return Path(folder) / f"compiled-{digest.hexdigest()}"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
