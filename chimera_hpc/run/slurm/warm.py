"""Compile what a sweep needs, once per node: ``python -m chimera_hpc.run.slurm.warm DIR|JOB``."""

from __future__ import annotations

from chimera_hpc.base.current_folder import leave_current_folder

if __name__ == "__main__":
    leave_current_folder()

import sys
from pathlib import Path

from chimera_hpc.run.compiled import compile_once, is_compiled
from chimera_hpc.store.ledger import METADATA, read_metadata

_STORE = "store.zarr"


def main(path: Path) -> None:
    """Compile the kernels of a sweep's points, unless the node has them.

    path: a job file, a sweep's folder or its store.
    """
    store = path if (path / METADATA).is_file() else path / _STORE
    # The other processes of the node wait meanwhile: a store is opened only to compile.
    if not path.is_file() and is_compiled(read_metadata(store)["attributes"]["spec"]):
        return
    from chimera_hpc.job import Sweep
    from chimera_hpc.store.store import Store

    sweep = Sweep.load(path) if path.is_file() else Store.open(store).sweep
    compile_once(sweep, sweep.points(), load=False)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
