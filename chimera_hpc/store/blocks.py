"""The chunk files of a block: one in each array, written and read whole."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from zarr.abc.buffer import Buffer
from zarr.buffer import cpu
from zarr.storage import MemoryStore

from chimera_hpc.base.files import write_together
from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.store.ledger import canonical, chunk_name, seal, sealed_size, unseal
from chimera_hpc.store.schema import (
    BLOCK_ARRAYS,
    OPTIONAL,
    ArrayPlan,
    block_plans,
    fill_of,
    is_undivided,
    series_plan,
    state_width,
)
from chimera_hpc.store.template import create_array

_INDEX_ENTRY = 16
"""Bytes of the index of a shard for each inner chunk: its offset and its length, uint64 both."""
_ABSENT = 2**64 - 1
"""Offset and length of an inner chunk that is not there."""


@dataclass(frozen=True)
class Damage:
    """A file of the store that is not what was written."""

    block: int
    array: str
    reason: str

    def __str__(self) -> str:
        return f"block {self.block}, {self.array}: {self.reason}"


class DamagedChunk(RuntimeError):
    """A chunk that the ledger vouches for is missing or cannot be decoded; `damage` says which."""

    def __init__(self, damage: Damage) -> None:
        super().__init__(f"{damage}; run the sweep again to compute the block again")
        self.damage = damage


@dataclass(frozen=True)
class BlockFiles:
    """Reads and writes the chunks of blocks, each as one whole array (block_size, ...)."""

    path: Path
    shapes: Mapping[str, tuple[int, ...]]
    """Shape of a chunk of each array that the store has.

    `u` is missing where no series is kept, and what is `OPTIONAL` in a store of an older version.
    """
    series_dtype: str
    piece: tuple[int, ...] = ()
    """Times and nodes of an inner chunk of `u`."""

    @classmethod
    def of(cls, path: Path, sweep: Sweep, block_size: int, nodes: Mapping[str, Any]) -> BlockFiles:
        """Return the files of a sweep's store; `nodes` are the metadata of its arrays."""
        kept: dict[str, Any] = {"n_state": state_width(nodes), "undivided": is_undivided(nodes)}
        planned = block_plans(sweep, block_size, block_size, **kept)
        without = OPTIONAL - set(nodes)
        plans = {plan.name: plan for plan in planned}
        names = [name for name in BLOCK_ARRAYS if name in plans and name not in without]
        shapes = {name: plans[name].shape for name in names}
        inner = plans["u"].inner if "u" in plans else None
        return cls(path, shapes, sweep.keep.dtype, (inner or ())[1:])

    @property
    def pieces(self) -> tuple[int, int]:
        """Into how many pieces the series of a point is cut, along time and along the nodes."""
        n_times, n_nodes = (
            -(-n // size) for n, size in zip(self.shapes["u"][1:], self.piece, strict=True)
        )
        return n_times, n_nodes

    def file(self, name: str, block: int) -> Path:
        return self.path / name / chunk_name(block, len(self.shapes[name]))

    def empty(self, name: str) -> NDArray[Any]:
        """Return the chunk of a block that never ran."""
        if name == "ledger":
            return np.full(self.shapes[name], Status.NEVER, dtype="<i8")
        if name != "u":
            return np.full(self.shapes[name], np.nan, dtype="<f8")
        return np.full(self.shapes[name], fill_of(self.series_dtype), dtype=self.series_dtype)

    def write(self, block: int, chunks: Mapping[str, NDArray[Any]]) -> int:
        """Write chunks by name of array, in this order; return their bytes when all are on disk."""
        contents = [
            (self.file(name, block), self._encode(name, chunk)) for name, chunk in chunks.items()
        ]
        write_together(contents)
        return sum(len(data) for _, data in contents)

    def read(self, name: str, block: int) -> NDArray[Any]:
        """Return a chunk, checksums verified; raise DamagedChunk when it is missing or damaged."""
        try:
            stored = self.file(name, block).read_bytes()
        except FileNotFoundError:
            raise DamagedChunk(Damage(block, name, "missing")) from None
        if name == "u":
            return self._decode_series(block, stored)
        data = unseal(stored, self._size(name))
        if data is None:
            reason = self._wrong_size(name, len(stored)) or "wrong checksum"
            raise DamagedChunk(Damage(block, name, reason))
        return np.frombuffer(data, "<i8" if name == "ledger" else "<f8").reshape(self.shapes[name])

    def look(self, name: str, block: int) -> Damage | None:
        """Check that a chunk is there and as long as it should be, without reading its data."""
        try:
            with self.file(name, block).open("rb") as file:
                size = file.seek(0, 2)
                if name != "u":
                    reason = self._wrong_size(name, size)
                else:
                    file.seek(max(0, size - self._index_size()))
                    reason = self._wrong_shard(file.read(), size)
        except FileNotFoundError:
            reason = "missing"
        return Damage(block, name, reason) if reason else None

    def places_of_series(self, block: int, row: int) -> dict[tuple[int, int], tuple[int, int]]:
        """Return where the pieces of a point's series are: offset and bytes of those that are kept.

        A piece is known by its number along time and along the nodes.
        """
        with self.file("u", block).open("rb") as file:
            file.seek(-self._index_size(), 2)
            index = np.frombuffer(file.read(), "<u8", count=self._index_entries() * 2)
        places = index.reshape(-1, *self.pieces, 2)[row]
        kept = np.argwhere(places[..., 0] != _ABSENT).tolist()
        return {(i, j): (int(places[i, j, 0]), int(places[i, j, 1])) for i, j in kept}

    def _encode(self, name: str, chunk: NDArray[Any]) -> bytes:
        if name == "u":
            return self._encode_series(chunk)
        if name == "ledger":
            return seal(np.ascontiguousarray(chunk, dtype="<i8").tobytes())
        return seal(canonical(chunk).tobytes())

    def _size(self, name: str) -> int:
        return 8 * int(np.prod(self.shapes[name]))

    def _wrong_size(self, name: str, size: int) -> str:
        expected = sealed_size(self._size(name))
        return "" if size == expected else f"{size} bytes instead of {expected}"

    def _encode_series(self, series: NDArray[Any]) -> bytes:
        files: dict[str, Buffer] = {}
        create_array(MemoryStore(files), self._series_plan())[...] = series
        chunk = files.get(self._series_key())
        if chunk is None:
            # Zarr writes no shard when no point has a series; ours says so in its index.
            return seal(b"\xff" * (_INDEX_ENTRY * self._index_entries()))
        return chunk.to_bytes()

    def _decode_series(self, block: int, stored: bytes) -> NDArray[Any]:
        reason = self._wrong_shard(stored[-self._index_size() :], len(stored))
        if reason:
            raise DamagedChunk(Damage(block, "u", reason))
        files: dict[str, Buffer] = {}
        array = create_array(MemoryStore(files), self._series_plan())
        files[self._series_key()] = cpu.Buffer.from_bytes(stored)
        try:
            return np.asarray(array[...])
        except Exception as error:
            # Each codec has its own way to say that bytes are not what it wrote.
            reason = f"cannot be decoded ({type(error).__name__})"
            raise DamagedChunk(Damage(block, "u", reason)) from error

    def _series_plan(self) -> ArrayPlan:
        shape = self.shapes["u"]
        return series_plan(shape, shape[0], self.series_dtype, self.piece)

    def _series_key(self) -> str:
        return f"u/{chunk_name(0, len(self.shapes['u']))}"

    def _index_size(self) -> int:
        return sealed_size(_INDEX_ENTRY * self._index_entries())

    def _index_entries(self) -> int:
        return self.shapes["u"][0] * math.prod(self.pieces)

    def _wrong_shard(self, tail: bytes, size: int) -> str:
        """Say what is wrong with a shard, by the index at its end; empty when nothing is."""
        data = unseal(tail, self._index_size() - sealed_size(0))
        if data is None:
            return "its index is damaged"
        index = np.frombuffer(data, "<u8").reshape(-1, 2)
        present = index[index[:, 0] != _ABSENT]
        end = int(present.sum(axis=1).max(initial=0)) + self._index_size()
        return "" if end == size else f"{size} bytes instead of {end}"
