"""Where blocks are computed: what the user chose, and the cluster that follows from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.memory import share_of_memory
from chimera_hpc.base.processes import usable_cores
from chimera_hpc.run.local_cluster import dask_size, existing_cluster, local_cluster

if TYPE_CHECKING:
    from distributed import Client

    from chimera_hpc.job.tables import Slurm

CLUSTERS = ("serial", "local", "scheduler-file", "slurm", "allocation")
Cluster = tuple["Client", Callable[[], bool]]
"""A client, and whether workers that are not there yet may still come."""


@dataclass(frozen=True)
class ExecutorChoice:
    """Where the blocks are computed."""

    kind: str
    """One of `CLUSTERS`."""
    workers: int = 0
    scheduler_file: Path | None = None
    memory: str | None = None
    """Memory of a worker, as `800M`."""
    slurm_options: Slurm | None = None
    """What is asked of SLURM."""
    share: tuple[int, int] | None = None
    """Which share of the blocks, of how many: block i belongs to share i modulo their number."""

    @property
    def n_workers(self) -> int:
        """Number of processes that compute blocks at a time; 1 if it is not known before."""
        return (self.workers or usable_cores()) if self.kind == "local" else 1

    @property
    def compiles_here(self) -> bool:
        """Whether this machine compiles the kernels: nodes of SLURM may be of another type."""
        return self.kind not in ("slurm", "allocation")

    @contextmanager
    def cluster(
        self,
        store: Path,
        n_blocks: int,
        say: Callable[[str], None],
        patience: float,
        meanwhile: Callable[[], object] | None = None,
    ) -> Iterator[Cluster]:
        """Start or join the chosen cluster.

        store: the store that the workers write.
        n_blocks: blocks to be computed; SLURM is asked for no more workers than that.
        say: called with each line for the user.
        patience: seconds after which a worker that gives no sign of life is given up.
        meanwhile: what to do in a thread while local workers start.
        """
        if self.kind == "slurm" and self.slurm_options is not None:
            from chimera_hpc.run.slurm.workers import slurm_cluster

            with slurm_cluster(self.slurm_options, store, n_blocks, say, patience) as found:
                client, keeper = found
                yield client, keeper.coming
        elif self.kind == "allocation" and self.slurm_options is not None:
            from chimera_hpc.run.slurm.allocation import allocation_cluster

            with allocation_cluster(self.slurm_options, store, say, patience) as client:
                yield client, _no_more
        elif self.scheduler_file is not None:
            with existing_cluster(self.scheduler_file, patience=patience) as client:
                yield client, _no_more
        else:
            if self.workers > usable_cores():
                say(_too_many(self.workers, usable_cores()))
            limit = dask_size(self.memory) if self.memory else None
            with local_cluster(
                self.workers, patience=patience, memory_limit=limit, meanwhile=meanwhile
            ) as client:
                yield client, _no_more


def _too_many(workers: int, cores: int) -> str:
    share = share_of_memory(workers) / 1e9
    return (
        f"warning: {workers} workers share {cores} cores: more workers than cores are no faster, "
        f"and each has {share:.3g} GB of memory unless --mem says otherwise; --workers {cores}"
    )


def _no_more() -> bool:
    return False
