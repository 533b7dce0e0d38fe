"""Compile what a sweep needs, once on a node: ``python -m chimera_hpc.slurm.warm DIR|JOB.toml``."""

from __future__ import annotations

import sys
from pathlib import Path


def main(path: Path) -> None:
    """Compile the kernels of a sweep's points, or find them compiled."""
    from chimera_hpc.grid import Sweep
    from chimera_hpc.store import Store
    from chimera_hpc.task import warm_up

    sweep = Sweep.load(path) if path.is_file() else Store.open(path / "store.zarr").sweep
    warm_up(sweep, sweep.points())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
