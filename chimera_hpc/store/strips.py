"""Some nodes of a stored series, without decoding the others.

A piece of a series is stored node by node, and Blosc compresses it in separate blocks. Some of
these blocks with a new header form a valid Blosc buffer.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import google_crc32c
import numpy as np
from numcodecs import Blosc
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import BlockFiles, Damage, DamagedChunk
from chimera_hpc.store.ledger import sealed_size
from chimera_hpc.store.schema import decode_series, fill_of, series_mask

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

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
        The chunk is missing or cut short; a damaged piece of it raises this when it is read.
    """

    def __init__(self, files: BlockFiles, point: int, size: int | None = None) -> None:
        self._block, row = divmod(point, files.shapes["u"][0])
        damage = files.look("u", self._block)
        if damage:
            raise DamagedChunk(damage)
        _, n_times, n_nodes = files.shapes["u"]
        self.shape = (n_nodes if size is None else size, n_times)
        self._piece = files.piece
        self._type = np.dtype(files.series_dtype)
        self._fill = fill_of(files.series_dtype)
        self._path: Path = files.file("u", self._block)
        self._places = files.places_of_series(self._block, row)
        self._opened: dict[tuple[int, int], _Buffer] = {}

    def __getitem__(self, nodes: slice) -> NDArray[np.float64]:
        """Return u of these nodes, (nodes, T); NaN where a sample is missing."""
        first, last, step = nodes.indices(self.shape[0])
        strips = [(first, last)] if step == 1 else [(i, i + 1) for i in range(first, last, step)]
        parts = [self.packed((0, self.shape[1]), strip) for strip in strips]
        return decode_series(np.concatenate([np.empty((0, self.shape[1]), self._type), *parts]))

    def in_memory(self) -> SeriesInMemory:
        """Return the whole series, as it is stored."""
        return SeriesInMemory(self.packed((0, self.shape[1]), (0, self.shape[0])).T)

    def packed(self, times: tuple[int, int], nodes: tuple[int, int]) -> NDArray[Any]:
        """Return u as it is stored, (nodes, times), from the first time and node to the last."""
        found = np.full((nodes[1] - nodes[0], times[1] - times[0]), self._fill, self._type)
        with self._path.open("rb") as file:
            for i, j in self._places:
                columns, inner_columns = _overlap(times, i, self._piece[0])
                rows, inner_rows = _overlap(nodes, j, self._piece[1])
                part = found[rows, columns]
                if part.size:
                    data = self._read(file, (i, j), inner_rows)
                    part[:] = data[:, inner_columns]
        return found

    def _read(self, file: BinaryIO, piece: tuple[int, int], nodes: slice) -> NDArray[Any]:
        buffer, row = self._open(file, piece), self._piece[0] * self._type.itemsize
        try:
            data = buffer.part(file, nodes.start * row, nodes.stop * row)
        except (RuntimeError, ValueError) as error:
            reason = f"piece {piece} of a series cannot be decoded ({error})"
            raise DamagedChunk(Damage(self._block, "u", reason)) from None
        return np.frombuffer(data, self._type).reshape(nodes.stop - nodes.start, -1)

    def _open(self, file: BinaryIO, piece: tuple[int, int]) -> _Buffer:
        if piece not in self._opened:
            offset, size = self._places[piece]
            size -= sealed_size(0)
            if _checksum(file, offset, size) != file.read(sealed_size(0)):
                raise DamagedChunk(Damage(self._block, "u", "wrong checksum"))
            self._opened[piece] = _Buffer(file, offset, size)
        return self._opened[piece]


class PackedSeries:
    """u of all points as it is stored, read a part at a time: ``series[points, times, nodes]``.

    The slices have the step 1. Points whose series is not kept, or that never ran, are missing.

    Attributes
    ----------
    shape, dtype, ndim
        As of the array `u`, (points, T, N).
    chunks : tuple of int
        What is best read at a time: at most about `PackedSeries.MOST` bytes.
    """

    MOST = 32_000_000
    ndim = 3

    def __init__(self, store: Store) -> None:
        self._store = store
        self._kept = series_mask(store.sweep, store.points.columns["seed"])
        self._kept &= store.ledger()["status"] != Status.NEVER
        self.shape = (store.n_points, *store.files.shapes["u"][1:])
        self.dtype = np.dtype(store.files.series_dtype)
        n_times, n_nodes = store.files.piece
        most = max(1, self.MOST // (n_times * self.dtype.itemsize))
        self.chunks = (1, n_times, min(n_nodes, most))
        self._last: tuple[int, StoredSeries] | None = None

    def __getitem__(self, parts: tuple[slice, slice, slice]) -> NDArray[Any]:
        points, times, nodes = (
            (first, last)
            for first, last, _ in (p.indices(n) for p, n in zip(parts, self.shape, strict=True))
        )
        shape = (points[1] - points[0], times[1] - times[0], nodes[1] - nodes[0])
        found = np.full(shape, fill_of(self.dtype.name), self.dtype)
        for row, i in enumerate(range(*points)):
            if self._kept[i]:
                found[row] = self._series(i).packed(times, nodes).T
        return found

    def _series(self, i: int) -> StoredSeries:
        # It knows which checksums hold.
        if self._last is None or self._last[0] != i:
            self._last = (i, StoredSeries(self._store.files, i))
        return self._last[1]


class SeriesInMemory:
    """u of a run in memory as a store keeps it, decoded as it is asked for, like `StoredSeries`.

    stored (T, N).
    """

    def __init__(self, stored: NDArray[Any]) -> None:
        self._stored = stored
        self.shape = stored.shape[::-1]

    def __getitem__(self, nodes: slice | NDArray[np.int64]) -> NDArray[np.float64]:
        """Return u of some nodes, (nodes, T)."""
        return decode_series(self._stored[:, nodes].T)

    def at(self, times: slice) -> NDArray[np.float64]:
        """Return u at some times, (times, N)."""
        return decode_series(self._stored[times])


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
    """Return the crc32c of `size` bytes, as it is stored; the file position is then after them."""
    file.seek(offset)
    checksum = 0
    while size > 0 and (data := file.read(min(size, _PIECE))):
        checksum = google_crc32c.extend(checksum, data)
        size -= len(data)
    return checksum.to_bytes(4, "little")


def _overlap(wanted: tuple[int, int], number: int, size: int) -> tuple[slice, slice]:
    """Return where the piece of this number lies in what is wanted, and that part in the piece."""
    begin = number * size
    first, last = max(wanted[0], begin), min(wanted[1], begin + size)
    last = max(first, last)
    return slice(first - wanted[0], last - wanted[0]), slice(first - begin, last - begin)
