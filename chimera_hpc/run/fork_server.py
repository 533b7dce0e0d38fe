"""The fork server of multiprocessing, from which the workers of a local cluster are forked.

It imports once what every worker needs. On platforms without a fork server, workers are spawned.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import resource_tracker
from pathlib import Path

from chimera_hpc.base.places import is_writable

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
"""Environment of a worker process: each library it calls computes with one thread."""
BLOCKED = frozenset({signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1})
"""Signals that a terminal or a batch system sends to all processes of a run. The driver takes them
and stops the workers; the fork server never does, a worker from `SignalPlugin.setup` on."""
_HASH_SEED = {"PYTHONHASHSEED": "6640"}
"""The seed that Dask gives each worker process."""
_SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""No module of the current folder stands in for a library."""
_LONGEST_FOLDER = 70
"""Bytes: the name of a Unix socket holds 104 or more, and multiprocessing adds 32 to a folder's."""


def start_fork_server() -> str:
    """Start the fork server unless one runs; return the start method of worker processes.

    The server ends with this process. Python's resource tracker is started too, such that it does
    not warn about the semaphores of killed workers, which it removes.
    """
    quiet = [os.environ.get("PYTHONWARNINGS"), "ignore:resource_tracker:UserWarning"]
    with _environment({"PYTHONWARNINGS": ",".join(filter(None, quiet))} | _SAFE_PATH):
        resource_tracker.ensure_running()
    folder = _folder_for_sockets()
    if folder is None or "forkserver" not in multiprocessing.get_all_start_methods():
        return "spawn"
    from multiprocessing import forkserver

    threads = {name: os.environ.get(name, value) for name, value in ONE_THREAD.items()}
    multiprocessing.set_forkserver_preload(["chimera_hpc.run.preload"])
    before, tempfile.tempdir = tempfile.tempdir, folder
    try:
        with _environment(threads | _HASH_SEED | _SAFE_PATH), signals_blocked():
            forkserver.ensure_running()
    finally:
        tempfile.tempdir = before
    return "forkserver"


def _folder_for_sockets() -> str | None:
    """Return the temporary folder, or ``/tmp`` if its name is too long for that of a socket."""
    for folder in (tempfile.gettempdir(), "/tmp"):
        if len(os.fsencode(folder)) <= _LONGEST_FOLDER and is_writable(Path(folder)):
            return folder
    return None


@contextmanager
def start_method(name: str) -> Iterator[None]:
    """Start processes by this method of multiprocessing.

    Dask uses it where its own option is None; its option "forkserver" would import pandas in this
    process, which takes 0.6 s.
    """
    before = multiprocessing.get_start_method(allow_none=True)
    multiprocessing.set_start_method(name, force=True)
    try:
        yield
    finally:
        multiprocessing.set_start_method(before, force=True)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Block `BLOCKED` in this thread, and in the threads and processes that it starts meanwhile."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, BLOCKED)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    """Change the environment of processes that are started meanwhile."""
    before = dict(os.environ)
    os.environ.update(changes)
    try:
        yield
    finally:
        for name in changes:
            if name in before:
                os.environ[name] = before[name]
            else:
                del os.environ[name]
