"""Compile what a store needs, once on a node: ``python -m chimera_hpc.slurm.warm STORE``."""

from __future__ import annotations

import sys
from pathlib import Path


def main(store: str) -> None:
    """Compile the kernels of a store's points, or find them compiled."""
    from chimera_hpc.store import Store
    from chimera_hpc.task import warm_up

    opened = Store.open(Path(store))
    warm_up(opened.sweep, opened.points)


if __name__ == "__main__":
    main(sys.argv[1])
