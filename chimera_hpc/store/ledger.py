"""The ledger, with the outcome of every point, read directly from its chunk files, without Zarr.

A chunk of the ledger is the plain little-endian bytes of (points of the block) x `FIELDS` int64,
followed by their crc32c (Zarr v3 codecs `bytes` and `crc32c`); `features` and `scalars` are stored
in the same way. A missing chunk means that no point of the block ever ran, and so does one that
cannot be trusted: wrong length or wrong checksum.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status

FIELDS = ("status", "attempts", "steps", "elapsed_us", "n_windows", "run", "digest")
FAILED = tuple(status for status in Status if status.is_failure)
RESULTS = tuple(status for status in Status if status.is_result)
NO_LIMIT = 2**62
"""More attempts than there are ever, and a higher number than any run has."""
SEPARATOR = "."
"""Between the parts of a chunk's name: the chunks of an array lie flat in its folder."""
METADATA = "zarr.json"
"""Root metadata, with the attributes and the metadata of all arrays."""
METADATA_COPY = "zarr.json.copy"
"""The same, with the crc32c of the metadata that it replaced and one of all that behind it."""
_CHECKSUM_BYTES = 4
_STRETCH = 256
"""Blocks whose ledger is in memory twice while it is read."""
_KNOWN = np.isin(np.arange(256), [int(status) for status in Status])
"""Whether each byte is the code of a status."""


@dataclass(frozen=True)
class LedgerScan:
    """Everything that the ledger says."""

    columns: dict[str, NDArray[np.int64]]
    """One entry per point for each of `FIELDS`; status 255 and zeros where a point never ran."""
    written: NDArray[np.bool_]
    """Whether each block has a sound ledger chunk."""
    damaged: tuple[int, ...]
    """Blocks whose ledger chunk is there, but of wrong length or checksum."""


def seal(data: bytes) -> bytes:
    """Return the data followed by its crc32c, as Zarr's codec `crc32c` stores it."""
    return data + _checksum(data)


def unseal(sealed: bytes, size: int) -> bytes | None:
    """Return the `size` bytes before the crc32c, or None when length or checksum is wrong."""
    if len(sealed) != size + _CHECKSUM_BYTES:
        return None
    data = sealed[:size]
    return data if _checksum(data) == sealed[size:] else None


def sealed_size(size: int) -> int:
    """Return the length of a sealed file of `size` bytes of data."""
    return size + _CHECKSUM_BYTES


def chunk_name(block: int, n_dimensions: int) -> str:
    """Return the name of a block's chunk file inside the folder of its array."""
    return SEPARATOR.join(["c", str(block), *["0"] * (n_dimensions - 1)])


def read_metadata(store: Path) -> dict[str, Any]:
    """Return the root metadata of a store, consolidated metadata of its arrays included.

    Where the file is not as it was written, its copy is read instead. Raises BadInput when the path
    is not a store of ours.
    """
    store = Path(store)
    if not store.is_dir():
        raise BadInput(f"{store}: not a sweep's store: no such folder")
    try:
        data = _bytes(store / METADATA)
        copy, trusted = _copy(store)
        root = _parse(data) if copy is None or _checksum(data) in trusted else None
        root = root or copy or _parse(data)
    except OSError as error:
        raise BadInput(f"{store}: not a sweep's store: {METADATA}: {error.strerror}") from None
    if root is None:
        raise BadInput(f"{store}: not a sweep's store: {METADATA} is missing, damaged, or not ours")
    return root


def read_copy(store: Path) -> dict[str, Any] | None:
    """Return the root metadata from their checksummed copy; None where that is no use."""
    return _copy(store)[0]


def metadata_copy(data: bytes, before: bytes) -> bytes:
    """Return the contents of `METADATA_COPY` for root metadata that replace those of `before`.

    It is written first. So the file of the root metadata is sound when it is what the copy says, or
    what was there before: then the write was broken off.
    """
    return seal(data + _checksum(before))


def _copy(store: Path) -> tuple[dict[str, Any] | None, tuple[bytes, ...]]:
    """Return the root metadata by their copy, and the checksums that their file may have."""
    sealed = _bytes(store / METADATA_COPY)
    whole = unseal(sealed, len(sealed) - _CHECKSUM_BYTES) or b""
    data, before = whole[:-_CHECKSUM_BYTES], whole[-_CHECKSUM_BYTES:]
    return _parse(data), (_checksum(data), before)


def ledger_shape(metadata: Mapping[str, Any]) -> tuple[int, int]:
    """Return the numbers of points of a store and of points in a block, from its root metadata."""
    ledger = metadata["consolidated_metadata"]["metadata"]["ledger"]
    return int(ledger["shape"][0]), int(ledger["chunk_grid"]["configuration"]["chunk_shape"][0])


def read_ledger(store: Path) -> dict[str, NDArray[np.int64]]:
    """Return the ledger's columns over all points of a store; see `LedgerScan.columns`."""
    return scan_ledger(store).columns


def scan_ledger(store: Path, metadata: Mapping[str, Any] | None = None) -> LedgerScan:
    """Read every ledger chunk and check its length and crc32c; a damaged one is no error."""
    n_points, block_size = ledger_shape(metadata or read_metadata(store))
    n_blocks = -(-n_points // block_size)
    # Zeros that nothing is written to take no memory.
    columns = {name: np.zeros(n_points, dtype=np.int64) for name in FIELDS}
    columns["status"][:] = Status.NEVER
    written = np.zeros(n_blocks, dtype=np.bool_)
    damaged: list[int] = []
    for first, paths in _stretches(_chunks(Path(store) / "ledger", n_blocks)):
        table = np.full((_STRETCH, block_size, len(FIELDS)), Status.NEVER, dtype="<i8")
        for block, path in paths:
            rows = _read_chunk(path, block_size)
            if rows is None:
                damaged.append(block)
            else:
                table[block - first] = rows
                written[block] = True
        here = slice(first * block_size, min((first + _STRETCH) * block_size, n_points))
        flat = table.reshape(-1, len(FIELDS))[: here.stop - here.start]
        for name, column in table_columns(flat).items():
            columns[name][here] = column
    return LedgerScan(columns, written, tuple(sorted(damaged)))


def read_block(store: Path, block: int, block_size: int) -> NDArray[np.int64] | None:
    """Return a ledger chunk, shape (block_size, fields); None when it is missing or damaged."""
    return _read_chunk(os.path.join(store, "ledger", chunk_name(block, 2)), block_size)


def table_columns(table: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """Return the rows of a ledger chunk as columns; see `LedgerScan.columns`."""
    never = table[:, 0] == Status.NEVER
    columns = {name: table[:, k].copy() for k, name in enumerate(FIELDS)}
    for name in FIELDS[1:]:
        columns[name][never] = 0
    return columns


def unfinished(
    columns: Mapping[str, NDArray[np.int64]],
    attempts: int = 0,
    statuses: Collection[Status] = FAILED,
    before: int = NO_LIMIT,
) -> NDArray[np.bool_]:
    """Tell which points are to be run: never run, or failed fewer than `attempts` times.

    `statuses` limits which failures are tried again, `before` to those of runs below this number.
    """
    status = columns["status"]
    again = np.isin(status, [int(code) for code in statuses]) & (columns["attempts"] < attempts)
    again &= columns["run"] < before
    return np.asarray((status == Status.NEVER) | again)


def with_those_behind(
    to_do: NDArray[np.bool_], status: NDArray[np.int64], block_size: int
) -> NDArray[np.bool_]:
    """Add to the points to be run those of a chain that were not started and lie behind them."""
    place = np.arange(len(to_do))
    last = np.maximum.accumulate(np.where(to_do, place, -1))
    behind = (last >= 0) & (last // block_size == place // block_size)
    return np.asarray(to_do | (behind & (status == Status.NOT_STARTED)))


def canonical(values: ArrayLike) -> NDArray[np.float64]:
    """Return a little-endian, contiguous copy with every NaN the same NaN, as it is stored."""
    copy = np.array(values, dtype="<f8", order="C")
    copy[np.isnan(copy)] = np.nan
    return copy


def digests(features: ArrayLike, scalars: ArrayLike) -> NDArray[np.int64]:
    """Return the signed 64-bit BLAKE2b digest of each point's results.

    features: (points, features, nodes)
    scalars: (points, quantities)
    """
    return stored_digests(canonical(features), canonical(scalars))


def stored_digests(
    features: NDArray[np.float64], scalars: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return what `digests` does, of values that are `canonical` already."""
    rows = zip(features, scalars, strict=True)
    return np.array([_digest(row, more) for row, more in rows], dtype=np.int64)


def point_digest(features: ArrayLike, scalars: ArrayLike) -> int:
    """Return the digest of one point: features (features, nodes), scalars (quantities,)."""
    return int(digests(np.asarray(features)[np.newaxis], np.asarray(scalars)[np.newaxis])[0])


def _checksum(data: bytes) -> bytes:
    checksum: int = google_crc32c.value(data)
    return checksum.to_bytes(_CHECKSUM_BYTES, "little")


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return b""


def _parse(data: bytes) -> dict[str, Any] | None:
    """Return root metadata if it is whole: its parts are there and do not contradict each other."""
    try:
        root = json.loads(data)
        attributes = root["attributes"]
        shape = (attributes["n_points"], attributes["block_size"])
        whole = ledger_shape(root) == shape and min(shape) > 0 and attributes["digest"]
        whole = whole and isinstance(attributes["spec"], dict)
    except (ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError):
        return None
    return dict(root) if whole else None


def _digest(*parts: NDArray[np.float64]) -> int:
    hashed = blake2b(digest_size=8)
    for part in parts:
        hashed.update(part.data)
    return int.from_bytes(hashed.digest(), "little", signed=True)


def _chunks(folder: Path, n_blocks: int) -> list[tuple[int, str]]:
    """Return (block, path) of the chunk files that are there."""
    names = os.listdir(folder) if folder.is_dir() else []
    parts = [(name, name.split(SEPARATOR)) for name in names]
    numbers = [(p[1], n) for n, p in parts if len(p) == 3 and p[0] == "c" and p[1].isdecimal()]
    return [(int(i), os.path.join(folder, n)) for i, n in numbers if int(i) < n_blocks]


def _stretches(chunks: list[tuple[int, str]]) -> Iterator[tuple[int, list[tuple[int, str]]]]:
    """Return the first block of each `_STRETCH` blocks of which there are chunks, and these."""
    found: dict[int, list[tuple[int, str]]] = {}
    for block, path in chunks:
        found.setdefault(block // _STRETCH * _STRETCH, []).append((block, path))
    yield from found.items()


def _read_chunk(path: str, block_size: int) -> NDArray[np.int64] | None:
    try:
        with open(path, "rb", buffering=0) as file:
            sealed = file.read()
    except OSError:
        return None
    data = unseal(sealed or b"", block_size * len(FIELDS) * 8)
    if data is None:
        return None
    rows = np.frombuffer(data, "<i8").reshape(block_size, len(FIELDS))
    return rows if _are_statuses(rows[:, 0]) else None


def _are_statuses(codes: NDArray[np.int64]) -> bool:
    """Whether all of these are codes of `Status`, as in every chunk that was written by us."""
    return codes.min() >= 0 and codes.max() < len(_KNOWN) and bool(_KNOWN[codes].all())
