"""Some nodes of a stored series, without decoding the others.

A series lies in its chunk node by node, compressed by Blosc in blocks of their own: a few blocks
with a header of their own are a Blosc buffer again.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import google_crc32c
import numpy as np
from numcodecs import Blosc
from numpy.typing import NDArray

from chimera_hpc.store.blocks import BlockFiles, Damage, DamagedChunk
from chimera_hpc.store.ledger import sealed_size
from chimera_hpc.store.schema import decode_series

_HEADER = struct.Struct("<4B3I")
"""Two versions, flags, bytes of a number; bytes of all, of a block, of the buffer."""
_PLAIN = 2
"""Flag of a buffer that is not compressed."""
_PIECE = 1 << 22
"""Bytes that are read at a time to verify a checksum."""


class StoredSeries:
    """u of one point, read as it is asked for: ``series[first:last]`` is an array (nodes, times).

    Parameters
    ----------
    files : BlockFiles
    point : int
        A point whose series is kept, and that has been run.
    size : int, optional
        Nodes that the point has; default: as many as fit.

    Raises
    ------
    DamagedChunk
        The chunk is missing or damaged; its checksum is verified here.
    """

    def __init__(self, files: BlockFiles, point: int, size: int | None = None) -> None:
        self._block, row = divmod(point, files.shapes["u"][0])
        damage = files.look("u", self._block)
        if damage:
            raise DamagedChunk(damage)
        _, n_times, n_nodes = files.shapes["u"]
        self.shape = (n_nodes if size is None else size, n_times)
        self._type = np.dtype(files.series_dtype)
        self._path: Path = files.file("u", self._block)
        self._buffer = self._open(files.place_of_series(self._block, row))

    def __getitem__(self, nodes: slice) -> NDArray[np.float64]:
        """Return u of these nodes, (nodes, T); NaN where a sample is missing."""
        first, last, step = nodes.indices(self.shape[0])
        pieces = [(first, last)] if step == 1 else [(i, i + 1) for i in range(first, last, step)]
        count = len(range(first, last, step))
        if not count or self._buffer is None:
            return np.full((count, self.shape[1]), np.nan)
        with self._path.open("rb") as file:
            return np.concatenate([self._read(file, *piece) for piece in pieces])

    def _read(self, file: BinaryIO, first: int, last: int) -> NDArray[np.float64]:
        assert self._buffer is not None
        row = self.shape[1] * self._type.itemsize
        try:
            data = self._buffer.part(file, first * row, last * row)
        except (RuntimeError, ValueError) as error:
            reason = f"nodes {first} to {last - 1} cannot be decoded ({error})"
            raise DamagedChunk(Damage(self._block, "u", reason)) from None
        return decode_series(np.frombuffer(data, self._type).reshape(last - first, -1))

    def _open(self, place: tuple[int, int] | None) -> _Buffer | None:
        if place is None:
            return None
        offset, size = place[0], place[1] - sealed_size(0)
        with self._path.open("rb") as file:
            if _checksum(file, offset, size) != file.read(sealed_size(0)):
                raise DamagedChunk(Damage(self._block, "u", "wrong checksum"))
            return _Buffer(file, offset, size)


class _Buffer:
    """A Blosc buffer of `size` bytes at an offset of a file."""

    def __init__(self, file: BinaryIO, offset: int, size: int) -> None:
        file.seek(offset)
        head = _HEADER.unpack(file.read(_HEADER.size))
        self._kind, (self._length, self._block, _) = head[:4], head[4:]
        self._offset, self._is_plain = offset, bool(head[2] & _PLAIN)
        if not self._is_plain:
            n_blocks = -(-self._length // self._block)
            self._starts = np.frombuffer(file.read(4 * n_blocks), "<u4")
            # Several threads write blocks as they get ready.
            order = np.append(np.sort(self._starts), size)
            self._ends = order[np.searchsorted(order, self._starts) + 1]

    def part(self, file: BinaryIO, first: int, last: int) -> bytes:
        """Return bytes `first` to `last` of what is compressed."""
        if self._is_plain:
            file.seek(self._offset + _HEADER.size + first)
            return file.read(last - first)
        begin, end = first // self._block, -(-last // self._block)
        if end * self._block > self._length:
            begin = min(begin, max(0, end - 2))  # Blosc wants one whole block
        data = Blosc().decode(self._cut(file, begin, end))
        return bytes(memoryview(data)[first - begin * self._block : last - begin * self._block])

    def _cut(self, file: BinaryIO, begin: int, end: int) -> bytes:
        """Return a buffer with these blocks alone."""
        blocks = list(self._blocks(file, begin, end))
        sizes = np.cumsum([_HEADER.size + 4 * len(blocks), *map(len, blocks)])
        length = min(end * self._block, self._length) - begin * self._block
        head = _HEADER.pack(*self._kind, length, self._block, sizes[-1])
        return b"".join([head, sizes[:-1].astype("<u4").tobytes(), *blocks])

    def _blocks(self, file: BinaryIO, begin: int, end: int) -> Iterator[bytes]:
        for start, stop in zip(self._starts[begin:end], self._ends[begin:end], strict=True):
            file.seek(self._offset + int(start))
            yield file.read(int(stop) - int(start))


def _checksum(file: BinaryIO, offset: int, size: int) -> bytes:
    """Return the crc32c of `size` bytes, as it is stored; the file then stands behind them."""
    file.seek(offset)
    checksum = 0
    while size > 0 and (data := file.read(min(size, _PIECE))):
        checksum = google_crc32c.extend(checksum, data)
        size -= len(data)
    return checksum.to_bytes(4, "little")
