"""Scratch memory of the stepping loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def aligned(*shape: int, fill: Callable[[int], Array] = np.zeros) -> Array:
    """Return an array, aligned to a cache line, of zeros or of what `fill` gives."""
    size = int(np.prod(shape))
    raw = fill(size + 8)
    offset = (-raw.ctypes.data // 8) % 8
    return raw[offset : offset + size].reshape(shape)


class _Kept(threading.local):
    buffer: Array | None = None


_kept = _Kept()


@contextmanager
def scratch_buffer(*shape: int) -> Iterator[Array]:
    """Provide an array with arbitrary contents. Each thread uses the same memory again.

    The system provides new memory at the first write to each page, which takes time. A second
    request while the buffer is in use gets new memory.
    """
    size = int(np.prod(shape))
    buffer, _kept.buffer = _kept.buffer, None
    if buffer is None or buffer.size < size:
        buffer = aligned(size, fill=np.empty)
    try:
        yield buffer[:size].reshape(shape)
    finally:
        _kept.buffer = buffer
