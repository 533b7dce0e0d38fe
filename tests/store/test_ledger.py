"""The ledger read raw: equal to Zarr's reading, with few calls, and unharmed by damaged chunks."""

from __future__ import annotations

import builtins
import json
import os
import struct
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st
from store_tools import fill, make_store
from zarr.abc.buffer import Buffer
from zarr.codecs import Crc32cCodec
from zarr.storage import MemoryStore

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.ledger import (
    FIELDS,
    canonical,
    chunk_name,
    digests,
    ledger_shape,
    point_digest,
    read_ledger,
    read_metadata,
    scan_ledger,
    seal,
    unfinished,
    unseal,
    with_those_behind,
)
from chimera_hpc.store.store import Store

PUBLISHED = 8490535021300479569
ALTERED_NAN = struct.unpack("<d", struct.pack("<Q", 0xFFF8000000000123))[0]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return fill(make_store(tmp_path_factory.mktemp("ledger")))


def damage(store: Store, block: int, alter: str) -> bytes:
    """Damage a ledger chunk and return its bytes as they were."""
    path = store.files.file("ledger", block)
    sound = path.read_bytes()
    altered = {
        "flipped": sound[:9] + bytes([sound[9] ^ 4]) + sound[10:],
        "cut": sound[:-5],
        "empty": b"",
        "longer": sound + b"\0",
    }
    path.write_bytes(altered[alter])
    return sound


def test_raw_reading_equals_zarrs(store: Store) -> None:
    table = np.asarray(zarr.open_array(store.path / "ledger", mode="r")[...])
    columns = read_ledger(store.path)
    assert tuple(columns) == FIELDS
    for k, name in enumerate(FIELDS):
        np.testing.assert_array_equal(columns[name], table[:, k])


def test_points_that_never_ran_have_status_255_and_zeros(tmp_path: Path) -> None:
    columns = read_ledger(make_store(tmp_path).path)
    assert set(columns["status"]) == {255}
    assert all((columns[name] == 0).all() for name in FIELDS[1:])
    assert len(columns["status"]) == 15


@pytest.mark.parametrize("alter", ["flipped", "cut", "empty", "longer"])
def test_damaged_chunk_counts_as_never_run_and_is_named(store: Store, alter: str) -> None:
    sound = damage(store, 2, alter)
    scan = scan_ledger(store.path)
    store.files.file("ledger", 2).write_bytes(sound)
    assert scan.damaged == (2,)
    assert np.flatnonzero(scan.columns["status"] == Status.NEVER).tolist() == [8, 9, 10, 11]
    assert scan.written.tolist() == [True, True, False, True]


def test_strangers_among_the_chunks_are_passed_over(tmp_path: Path) -> None:
    store = fill(make_store(tmp_path))
    before = scan_ledger(store.path)
    for name in (".c.0.0.x-1-2.ab.partial", "c.99.0", "c.x.0", "c.1", "old.1.0"):
        (store.path / "ledger" / name).write_bytes(b"?")
    after = scan_ledger(store.path)
    assert after.damaged == before.damaged == ()
    np.testing.assert_array_equal(after.columns["digest"], before.columns["digest"])


def test_a_thousand_chunks_are_read_with_one_listing_and_one_opening_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = make_store(tmp_path, "seeds=20000", "grid.P=2", "run.block=20")
    assert store.n_blocks == 1000
    data = seal(np.ones((20, len(FIELDS)), "<i8").tobytes())
    for block in range(store.n_blocks):
        (store.path / "ledger" / chunk_name(block, 2)).write_bytes(data)
    looks: Counter[str] = Counter()
    for module, name in ((builtins, "open"), (os, "listdir"), (os, "stat")):
        monkeypatch.setattr(module, name, counted(looks, name, getattr(module, name)))
    columns = read_ledger(store.path)
    monkeypatch.undo()
    assert (looks["open"], looks["listdir"]) == (1000, 1)
    assert looks["stat"] < 10
    assert (columns["status"] == Status.DONE).all()


def counted(counts: Counter[str], name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function, which counts its calls."""

    def call(*args: Any, **options: Any) -> Any:
        counts[name] += 1
        return function(*args, **options)

    return call


def test_reading_the_ledger_does_not_import_zarr(store: Store) -> None:
    code = (
        "import sys; from chimera_hpc.store.ledger import read_ledger;"
        f"assert len(read_ledger({str(store.path)!r})['status']) == 15;"
        "heavy = {'zarr', 'numba', 'sklearn', 'dask', 'pydantic'} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@given(st.binary(max_size=200))
def test_seal_writes_what_zarrs_codec_writes(data: bytes) -> None:
    files: dict[str, Buffer] = {}
    array = zarr.create_array(
        MemoryStore(files), shape=(len(data) + 1,), dtype="u1", compressors=[Crc32cCodec()]
    )
    array[:] = np.frombuffer(data + b"\1", "u1")
    assert files["c/0"].to_bytes() == seal(data + b"\1")


@given(st.binary(max_size=50), st.integers(0, 10**6), st.integers(1, 255))
def test_unseal_refuses_any_altered_byte(data: bytes, place: int, change: int) -> None:
    sealed = bytearray(seal(data))
    assert unseal(bytes(sealed), len(data)) == data
    sealed[place % len(sealed)] ^= change
    assert unseal(bytes(sealed), len(data)) is None


def test_digest_is_blake2b_of_the_stored_bytes() -> None:
    features, scalars = np.arange(16.0).reshape(8, 2), np.array([0.5, np.nan])
    stored = features.astype("<f8").tobytes() + struct.pack("<dQ", 0.5, 0x7FF8000000000000)
    hashed = blake2b(stored, digest_size=8).digest()
    assert point_digest(features, scalars) == struct.unpack("<q", hashed)[0]
    # Published, so that a change of the rule cannot pass unseen.
    assert point_digest(features, scalars) == PUBLISHED


def test_every_nan_gives_the_same_digest_and_the_same_bytes() -> None:
    features = np.full((1, 8, 3), np.nan)
    altered = np.full((1, 8, 3), ALTERED_NAN)
    scalars = np.zeros((1, 4))
    assert altered.tobytes() != features.tobytes()
    assert digests(features, scalars) == digests(altered, scalars)
    assert canonical(altered).tobytes() == canonical(features).tobytes()


@given(st.integers(0, 23), st.integers(0, 3))
def test_digest_depends_on_every_number(feature: int, scalar: int) -> None:
    rng = np.random.default_rng(1)
    features, scalars = rng.normal(size=(8, 3)), rng.normal(size=4)
    other_features, other_scalars = features.copy(), scalars.copy()
    other_features.flat[feature] = np.nextafter(features.flat[feature], 9.0)
    other_scalars[scalar] = np.nextafter(scalars[scalar], 9.0)
    known = point_digest(features, scalars)
    assert known not in {
        point_digest(other_features, scalars),
        point_digest(features, other_scalars),
    }


def test_unfinished_are_the_never_run_and_the_failures_asked_for() -> None:
    columns = {
        "status": np.array([255, 1, 2, 4, 6, 8]),
        "attempts": np.array([0, 1, 1, 1, 2, 3]),
        "run": np.array([0, 1, 1, 1, 2, 1]),
    }
    assert unfinished(columns).tolist() == [True, False, False, False, False, False]
    assert unfinished(columns, 3).tolist() == [True, False, False, True, True, False]
    only = unfinished(columns, 9, [Status.STEP_BUDGET])
    assert only.tolist() == [True, False, False, False, True, False]
    earlier = unfinished(columns, 9, before=2)
    assert earlier.tolist() == [True, False, False, True, False, True]


def test_points_that_a_chain_left_are_run_with_the_first_one_before_them() -> None:
    status = np.full(8, Status.NOT_STARTED, dtype=np.int64)
    status[[0, 4, 6]] = Status.TIME_OUT, Status.DONE, Status.TIME_OUT
    found = with_those_behind(status == Status.TIME_OUT, status, 4)
    assert np.flatnonzero(found).tolist() == [0, 1, 2, 3, 6, 7]


def test_not_a_store_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "none", tmp_path / "file", tmp_path):
        with pytest.raises(BadInput, match="not a sweep's store"):
            read_metadata(path)


@pytest.mark.parametrize("contents", [b"", b"{", b"[]", b'{"attributes": {}}', None])
def test_damaged_root_metadata_are_read_from_their_copy(tmp_path: Path, contents: bytes) -> None:
    store = fill(make_store(tmp_path))
    before = read_metadata(store.path)
    root = store.path / "zarr.json"
    root.unlink() if contents is None else root.write_bytes(contents)
    assert read_metadata(store.path) == before
    assert (read_ledger(store.path)["status"] == Status.DONE).all()


def test_damaged_root_with_a_damaged_copy_is_bad_input(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    copy = (store.path / "zarr.json.copy").read_bytes()
    (store.path / "zarr.json").write_bytes(b"{")
    (store.path / "zarr.json.copy").write_bytes(copy[:50] + b"#" + copy[51:])
    with pytest.raises(BadInput, match="missing, damaged, or not ours"):
        read_metadata(store.path)


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
values = st.recursive(leaves, lambda s: st.lists(s, max_size=3) | st.dictionaries(st.text(), s))


@settings(max_examples=60)
@given(st.data())
def test_no_root_metadata_whatever_raise_anything_but_bad_input(
    store: Store, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    root = json.loads((store.path / "zarr.json").read_bytes())
    place = root
    for key in data.draw(st.sampled_from(PLACES)):
        last, place = place, place[key]
    last[key] = data.draw(values)
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "zarr.json").write_text(json.dumps(root))
    try:
        opened = Store.open(folder)
    except BadInput:
        return
    assert ledger_shape(opened.metadata) == (15, 4)


PLACES = [
    ("attributes",),
    ("attributes", "spec"),
    ("attributes", "spec", "grid"),
    ("attributes", "spec", "grid", "P"),
    ("attributes", "spec", "keep"),
    ("attributes", "digest"),
    ("attributes", "n_points"),
    ("attributes", "block_size"),
    ("consolidated_metadata",),
    ("consolidated_metadata", "metadata"),
    ("consolidated_metadata", "metadata", "ledger"),
    ("consolidated_metadata", "metadata", "ledger", "shape"),
    ("consolidated_metadata", "metadata", "ledger", "chunk_grid"),
    ("consolidated_metadata", "metadata", "features"),
    ("consolidated_metadata", "metadata", "u", "data_type"),
    ("consolidated_metadata", "metadata", "u", "chunk_grid", "configuration", "chunk_shape"),
]
