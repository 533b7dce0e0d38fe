"""Whatever happens to a file of the store is found, named, and put right."""

from __future__ import annotations

import json
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from store_tools import block_results, results, small_sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import DamagedChunk
from chimera_hpc.store.claims import claim_block
from chimera_hpc.store.store import Store

ARRAYS = ("u", "features", "scalars", "quality", "ledger")


@pytest.fixture
def store(filled: Store) -> Store:
    return filled


def flip(path: Path, place: int, bit: int = 0) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


def named(store: Store, deep: bool) -> list[tuple[int, str]]:
    return [(damage.block, damage.array) for damage in store.find_damaged(deep)]


def redo(store: Store) -> None:
    for block in store.pending():
        rows = store.points_to_do(block)
        made = results(store, store.block(block)[0] + rows)
        store.write_block(block, made, 2, 1, rows=rows)


@pytest.mark.parametrize("array", ARRAYS)
@pytest.mark.parametrize("alter", ["cut", "empty", "lost", "longer"])
def test_wrong_length_is_found_without_reading_the_data(
    store: Store, array: str, alter: str
) -> None:
    wanted = store.features(), store.ledger()["digest"]
    path = store.files.file(array, 1)
    sound = path.read_bytes()
    contents = {"cut": sound[:-1], "empty": b"", "longer": sound + b"\0"}
    path.unlink() if alter == "lost" else path.write_bytes(contents[alter])
    if (array, alter) != ("ledger", "lost"):
        assert named(store, deep=False) == named(store, deep=True) == [(1, array)]
    assert store.pending() == [1]
    assert store.points_to_do(1).tolist() == [0, 1, 2, 3]
    redo(store)
    assert named(store, deep=True) == []
    np.testing.assert_array_equal(store.features(), wanted[0])
    np.testing.assert_array_equal(store.ledger()["digest"], wanted[1])


def test_shard_with_a_hole_is_found_without_reading_the_data(store: Store) -> None:
    path = store.files.file("u", 1)
    sound = path.read_bytes()
    path.write_bytes(sound[10:])
    wrong = f"{len(sound) - 10} bytes instead of {len(sound)}"
    assert [str(d) for d in store.find_damaged()] == [f"block 1, u: {wrong}"]


@pytest.mark.parametrize("array", ARRAYS)
def test_any_flipped_bit_is_found_by_the_deep_check(store: Store, array: str) -> None:
    path = store.files.file(array, 2)
    sound = path.read_bytes()
    rng = np.random.default_rng(2)
    for _ in range(30):
        flip(path, int(rng.integers(len(sound))), int(rng.integers(8)))
        assert named(store, deep=True) == [(2, array)]
        path.write_bytes(sound)
    assert named(store, deep=True) == []


def test_damaged_block_is_named_with_its_array(store: Store) -> None:
    flip(store.files.file("features", 2), 100)
    store.files.file("u", 3).unlink()
    lines = [str(damage) for damage in store.find_damaged(deep=True)]
    assert lines == ["block 2, features: wrong checksum", "block 3, u: missing"]


def test_bytes_that_do_not_belong_to_the_ledger_are_found(store: Store) -> None:
    other = store.files.file("features", 0).read_bytes()
    store.files.file("features", 1).write_bytes(other)
    assert named(store, deep=False) == []
    assert [str(damage) for damage in store.find_damaged(deep=True)] == [
        "block 1, features or scalars: another digest than the ledger's, in 4 points"
    ]


def test_reading_what_is_damaged_raises_and_says_where(store: Store) -> None:
    flip(store.files.file("features", 2), 100)
    with pytest.raises(DamagedChunk, match="block 2, features: wrong checksum; run the sweep"):
        store.features()
    flip(store.files.file("u", 0), 10)
    with pytest.raises(DamagedChunk, match="block 0, u: point 0 of it cannot be decoded"):
        store.series(0)
    assert np.isfinite(store.series(1)).all()
    store.files.file("scalars", 3).unlink()
    with pytest.raises(DamagedChunk, match="block 3, scalars: missing"):
        store.scalars()


def test_rewriting_a_damaged_block_keeps_nothing_of_it_but_the_attempts(store: Store) -> None:
    flip(store.files.file("u", 1), 3)
    assert named(store, deep=True) == [(1, "u")]
    store.discard_block(1)
    assert store.pending() == [1]
    redo(store)
    assert named(store, deep=True) == []
    store.files.file("u", 2).write_bytes(b"not a shard")
    redo(store)
    assert named(store, deep=True) == []
    assert store.ledger()["attempts"].tolist() == [1] * 8 + [2] * 4 + [1] * 3


def test_a_file_that_a_network_file_system_shows_late_is_waited_for(store: Store) -> None:
    path = store.files.file("scalars", 1)
    hidden = path.rename(path.with_name("hidden"))
    assert named(store, deep=False) == [(1, "scalars")]

    def show() -> None:
        time.sleep(0.2)
        hidden.rename(path)

    thread = threading.Thread(target=show)
    thread.start()
    assert store.find_damaged(patience=20.0) == []
    thread.join()


def test_damaged_attributes_are_restored_from_their_copy(store: Store) -> None:
    root = store.path / "zarr.json"
    sound = root.read_bytes()
    changes = [(b'"P": "2:4"', b'"P": "2:5"'), (b'"crc32c"', b'"crc32d"'), (b"small", b"smell")]
    changes.append((b'"data_type": "int16"', b'"data_type": "int64"'))
    altered = [sound.replace(*change) for change in changes]
    for spoilt in (b"", sound[:1000], *altered):
        assert spoilt != sound
        root.write_bytes(spoilt)
        opened = Store.open(store.path)
        assert opened.sweep == small_sweep()
        assert opened.status()[Status.DONE] == 15
        assert opened.repair() == ["zarr.json rewritten"]
        assert root.read_bytes() == sound
        assert opened.repair() == []


def test_attributes_damaged_beyond_repair_are_bad_input(store: Store) -> None:
    (store.path / "zarr.json.copy").unlink()
    root = json.loads((store.path / "zarr.json").read_bytes())
    root["attributes"]["spec"]["fixed"]["epsilon"] = 0.06
    (store.path / "zarr.json").write_text(json.dumps(root))
    with pytest.raises(BadInput, match="spec, specs and digest do not belong together"):
        Store.open(store.path)


def test_array_metadata_that_contradict_the_spec_are_bad_input(store: Store) -> None:
    root = store.path / "zarr.json"
    (store.path / "zarr.json.copy").unlink()
    root.write_bytes(root.read_bytes().replace(b'"data_type": "int16"', b'"data_type": "int64"'))
    with pytest.raises(BadInput, match="the metadata of 'u' are damaged"):
        Store.open(store.path)


@pytest.mark.parametrize("shape", [False, [0]])
def test_coordinates_in_chunks_of_size_0_are_bad_input(store: Store, shape: object) -> None:
    file = store.path / "zarr.json"
    root = json.loads(file.read_bytes())
    node = root["consolidated_metadata"]["metadata"]["P"]
    node["chunk_grid"]["configuration"]["chunk_shape"] = shape
    file.write_text(json.dumps(root))
    (store.path / "zarr.json.copy").unlink()
    with pytest.raises(BadInput, match="the metadata of 'P' are damaged"):
        Store.open(store.path)


def test_damaged_coordinates_and_array_metadata_are_rewritten(store: Store) -> None:
    flip(store.path / "seed" / "c.0", 5)
    assert store.repair() == ["coordinates rewritten"]
    (store.path / "P" / "c.0").unlink()
    assert store.repair() == ["coordinates rewritten"]
    (store.path / "features" / "zarr.json").write_text("{")
    assert store.repair() == ["features/zarr.json rewritten"]
    assert store.repair() == []


def test_only_left_over_temporary_files_are_removed(store: Store) -> None:
    folder = store.path / "u"
    mine = folder / f".c.0.0.0.{_mark(os.getpid())}.ab.partial"
    dead = folder / f".c.0.0.0.{_mark(4194303)}.ab.partial"
    foreign = folder / ".c.0.0.0.00000000-1-1.ab.partial"
    old = folder / ".c.1.0.0.00000000-1-1.ab.partial"
    metadata = store.path / "P" / f".zarr.json.{_mark(4194303)}.ab.partial"
    for path in (mine, dead, foreign, old, metadata):
        path.write_bytes(b"half")
    os.utime(old, (1, 1))
    assert store.repair() == ["3 temporary files removed"]
    assert not metadata.exists()
    assert sorted(folder.glob(".*")) == sorted([mine, foreign])


def _mark(pid: int) -> str:
    from chimera_hpc.base.processes import process_identity

    machine, _, start = process_identity().split("-")
    return f"{machine}-{pid}-{start}"


def test_claims_of_the_dead_on_finished_blocks_are_removed(store: Store) -> None:
    folder = store.path / "claims"
    folder.mkdir()
    store.discard_block(3)
    for block in (1, 3):
        dead = {"process": _mark(4194303), "token": "x", "expiry": 60}
        (folder / f"{block}.1.json").write_text(json.dumps(dead))
    assert claim_block(store.path, 2, 1) is not None
    assert store.repair() == ["1 claims on finished blocks removed"]
    assert sorted(path.name for path in folder.iterdir()) == ["2.1.json", "3.1.json"]


def test_no_bytes_whatever_in_a_chunk_make_the_checks_fail(store: Store) -> None:
    rng = np.random.default_rng(7)
    for array in ARRAYS:
        path = store.files.file(array, 0)
        sound = path.read_bytes()
        for size in (0, 1, 3, 4, 5, len(sound) // 2, len(sound), len(sound) + 7):
            path.write_bytes(rng.bytes(size))
            assert named(store, deep=True) == [(0, array)]
            assert store.pending() == [0] or size == len(sound)
        path.write_bytes(sound)


def test_block_written_while_others_are_damaged_is_sound(store: Store) -> None:
    store.discard_block(0)
    flip(store.files.file("ledger", 1), 8)
    store.write_block(0, block_results(store, 0), 1, 1)
    assert named(store, deep=True) == [(1, "ledger")]
