"""What every Dask worker process does before its first block (a Dask "preload")."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from distributed import Worker


def dask_setup(worker: Worker) -> None:
    """Leave Ctrl-C to the driver: it stops the workers in good order.

    A terminal sends SIGINT to all processes of the run at once.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
