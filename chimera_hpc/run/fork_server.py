"""A process that workers of a local cluster are forked from, so that they start with all imports.

It gets ready while the driver plans. Where the platform has none, workers are spawned.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

ONE_THREAD = {
    name: "1"
    for name in (
        "OMP_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "NUMBA_NUM_THREADS",
    )
}
"""Environment of a worker process: it computes with one thread, whatever library it calls."""
METHOD = "forkserver"
_HASH_SEED = {"PYTHONHASHSEED": "6640"}
"""The seed that Dask gives each worker process."""
IS_SERVER = "CHIMERA_HPC_FORK_SERVER"
"""Variable that tells a fork server's process what it is; no worker has it."""
_READY_MADE = ["chimera_hpc.run.forked"]


@contextmanager
def fork_server(wanted: bool = True) -> Iterator[None]:
    """Have a fork server get ready while the driver does what is inside; end it afterwards.

    A program that has a fork server of its own keeps it; workers are spawned then.
    """
    if not wanted or not _is_possible():
        yield
        return
    before = _server()._preload_modules
    _start()
    try:
        yield
    finally:
        _stop()
        _server().set_forkserver_preload(before)


def is_running() -> bool:
    """Return whether `fork_server` has started one that was not stopped."""
    return _has_method() and bool(_server()._preload_modules == _READY_MADE)


@contextmanager
def environment(changes: Mapping[str, str]) -> Iterator[None]:
    """Change the environment of processes that are started meanwhile."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def quiet_tracker() -> dict[str, str]:
    """Return what keeps Python from telling about the semaphores of workers that were killed.

    They are cleaned up all the same, by a process that takes its orders from the environment.
    """
    said = [os.environ.get("PYTHONWARNINGS"), "ignore:resource_tracker:UserWarning"]
    return {"PYTHONWARNINGS": ",".join(filter(None, said))}


def _is_possible() -> bool:
    return _has_method() and _server()._forkserver_pid is None


def _has_method() -> bool:
    import multiprocessing

    return METHOD in multiprocessing.get_all_start_methods()


def _server() -> Any:
    # Typed loosely: Python has no public name for what ends a fork server before its time.
    from multiprocessing import forkserver

    return forkserver._forkserver


def _start() -> None:
    from multiprocessing import resource_tracker

    # What a user has set counts, as with Dask.
    threads = {name: os.environ.get(name, value) for name, value in ONE_THREAD.items()}
    with environment({**threads, **_HASH_SEED, **quiet_tracker(), IS_SERVER: "1"}):
        # First, for its start lets Ctrl-C through again.
        resource_tracker.ensure_running()
        _server().set_forkserver_preload(_READY_MADE)
        # A Ctrl-C is for the driver. The server takes it from here as blocked, until it ignores it.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            _server().ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _stop() -> None:
    """End the server at once, even while it imports: nobody shall wait for it."""
    server = _server()
    if server._forkserver_pid is not None:
        with suppress(ProcessLookupError):
            os.kill(server._forkserver_pid, signal.SIGKILL)
        with suppress(ChildProcessError):
            server._stop()
