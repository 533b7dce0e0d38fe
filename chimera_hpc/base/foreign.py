"""Record when each thread of this process entered a user's code, which may never return."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import get_ident

_entered: dict[int, float] = {}
"""Identifier of the thread -> monotonic time (s)."""
# A forked process has none of the other threads.
os.register_at_fork(after_in_child=_entered.clear)


@contextmanager
def foreign_code() -> Iterator[None]:
    """Mark that this thread calls what a user has written, such as a right-hand side."""
    thread = get_ident()
    before = _entered.get(thread)
    _entered[thread] = time.monotonic()
    try:
        yield
    finally:
        _entered.pop(thread, None)
        if before is not None:
            _entered[thread] = time.monotonic()


def first_entry() -> float | None:
    """Return the earliest entry of a thread that is still in such code, or None.

    The time is that of the monotonic clock (s).
    """
    return min(_entered.copy().values(), default=None)
