"""What the fork server does before the first worker is forked from it, when it imports this.

A worker's first block needs all of this. None of it starts a thread: a process with threads must
not fork.
"""

from __future__ import annotations

import gc
import os
import signal
from importlib import import_module

from chimera_hpc.run.fork_server import IS_SERVER

_MODULES = (
    *("numpy", "chimera_hpc.job", "numba", "chimera_hpc.run.block", "chimera_hpc.store"),
    *("chimera_hpc.run.work", "chimera_hpc.run.executors", "distributed", "chimera_hpc.run.worker"),
)
"""In small steps: between them it is seen whether the driver is still there."""

_OUTLIVED = (signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
"""What a batch system sends to all processes of a job: workers take it each in its own way, and the
driver would give them up without their server."""


def _get_ready() -> None:
    driver = os.getppid()
    _take_signals()
    # What is imported is no garbage, here and in the workers.
    gc.disable()
    for name in _MODULES:
        if os.getppid() != driver:
            os._exit(0)
        import_module(name)
    from chimera_hpc.integrate.jit import load_registries

    load_registries()
    gc.freeze()
    gc.enable()


def _take_signals() -> None:
    # A terminal sends Ctrl-C to all processes of a run; the driver stops the workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    taken = [number for number in _OUTLIVED if signal.getsignal(number) == signal.SIG_DFL]
    for number in taken:
        signal.signal(number, signal.SIG_IGN)

    def as_before() -> None:
        for number in taken:
            if signal.getsignal(number) == signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)

    os.register_at_fork(after_in_child=as_before)


# Whoever imports this otherwise, as tools do that look at all modules, keeps his signals.
if os.environ.pop(IS_SERVER, None) is not None:
    _get_ready()
