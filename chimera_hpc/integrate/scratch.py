"""Memory that the stepping loop works on."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def aligned(*shape: int, fill: Callable[[int], Array] = np.zeros) -> Array:
    """Zeros, or what `fill` gives, from the start of a cache line: no vector load straddles two."""
    size = int(np.prod(shape))
    raw = fill(size + 8)
    offset = (-raw.ctypes.data // 8) % 8
    return raw[offset : offset + size].reshape(shape)


class _Kept(threading.local):
    room: Array | None = None


_kept = _Kept()


@contextmanager
def lent(*shape: int) -> Iterator[Array]:
    """Lend an array that holds anything; this thread gets the same memory again the next time.

    New memory comes from the system page by page, whenever a page is first written to, and that
    takes time. Whoever asks while the room is lent gets some of his own.
    """
    size = int(np.prod(shape))
    room, _kept.room = _kept.room, None
    if room is None or room.size < size:
        room = aligned(size, fill=np.empty)
    try:
        yield room[:size].reshape(shape)
    finally:
        _kept.room = room
