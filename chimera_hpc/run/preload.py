"""What the fork server imports before it forks the first worker. None of it starts a thread."""

from numba.core.registry import cpu_target

from chimera_hpc.run import executors, work, worker

__all__ = ["executors", "work", "worker"]

# numba reads its list of functions here, not for the first kernel of each worker.
cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
