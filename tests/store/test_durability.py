"""What a loss of power leaves: everything is on the disk before the rename that makes it count."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from store_tools import block_results, fill, make_store, small_sweep

from chimera_hpc.store.merge import merge
from chimera_hpc.store.store import Store

MORE = small_sweep("seeds=8", "grid.P=2:5")
State = tuple[int, int, int]


class Killed(Exception):
    """Stands for the end of the process."""


def state(path: Path | int) -> State:
    """Tell a file or folder as it is now from what it was, and will be, after another change."""
    found = os.stat(path)
    return found.st_ino, found.st_size, found.st_mtime_ns


def walk(tree: Path) -> list[Path]:
    return [tree, *(path for path in tree.rglob("*") if "claims" not in path.parts)]


class Disk:
    """Knows which files and folders were flushed; looks at a tree when a name is given."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.safe: set[State] = set()
        self.counting, self.tree = Path(), Path()
        self.unflushed: list[str] | None = None
        """What of the tree was not on the disk when the counting name was given."""
        fsync, replace, rename = os.fsync, os.replace, os.rename

        def flush(descriptor: int) -> None:
            self.safe.add(state(descriptor))
            fsync(descriptor)

        def looking(move: Callable[..., None]) -> Callable[..., None]:
            def look(source: Path, target: Path) -> None:
                if Path(target) == self.counting:
                    tree = Path(source) if self.tree == Path() else self.tree
                    self.unflushed = [
                        path.relative_to(tree).as_posix()
                        for path in walk(tree)
                        if state(path) not in self.safe
                    ]
                move(source, target)

            return look

        monkeypatch.setattr(os, "fsync", flush)
        monkeypatch.setattr(os, "replace", looking(replace))
        monkeypatch.setattr(os, "rename", looking(rename))

    def look_when_named(self, counting: Path, tree: Path | None = None) -> None:
        """Look at `tree`, whose present state is safe, or at what is renamed, at this rename."""
        self.counting = counting
        if tree is not None:
            self.tree = tree
            self.safe |= {state(path) for path in walk(tree)}


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


def test_a_plan_is_on_the_disk_before_it_has_its_name(tmp_path: Path, disk: Disk) -> None:
    disk.look_when_named(tmp_path / "store.zarr")
    store = make_store(tmp_path)
    assert disk.unflushed == []
    assert len(walk(store.path)) > 2 * len(store.points.columns)
    assert state(tmp_path) in disk.safe


def test_a_merged_store_is_on_the_disk_before_it_has_its_name(tmp_path: Path, disk: Disk) -> None:
    parts = []
    for name, seeds in (("a", "seeds=2"), ("b", "seeds=[2,3]")):
        parts.append(fill(make_store(tmp_path / name, seeds)))
        parts[-1].start_run({"started": "today"})
    folder = tmp_path / "all"
    disk.look_when_named(folder / "store.zarr")
    merge(folder / "store.zarr", parts)
    assert disk.unflushed == []
    assert state(folder) in disk.safe


def test_an_extension_is_on_the_disk_before_its_root_is(filled: Store, disk: Disk) -> None:
    disk.look_when_named(filled.path / "zarr.json", filled.path)
    before = set(disk.safe)
    filled.extend(MORE)
    # The temporary file of the root, flushed already, lies in the root's folder.
    assert disk.unflushed == ["."]
    assert state(filled.path / "zarr.json") in disk.safe
    assert state(filled.path) in disk.safe
    changed = {path.parent.name for path in walk(filled.path) if state(path) not in before}
    assert changed > {"P", "Q", "seed", "u", "features", "scalars", "quality", "ledger"}


def test_data_of_a_block_are_on_the_disk_before_its_ledger_is(filled: Store, disk: Disk) -> None:
    filled.discard_block(2)
    for name in ("u", "features", "scalars", "quality"):
        filled.files.file(name, 2).unlink()
    disk.look_when_named(filled.files.file("ledger", 2), filled.path)
    filled.write_block(2, block_results(filled, 2), 2, 1)
    assert disk.unflushed == ["ledger"]
    for path in (filled.files.file("ledger", 2), filled.path / "ledger"):
        assert state(path) in disk.safe


def test_a_reduction_is_on_the_disk_before_it_has_its_name(filled: Store, disk: Disk) -> None:
    disk.look_when_named(filled.path / "reduction")
    filled.write_reduction({"a": (("k",), [1.0]), "b": (("k",), [2])}, {})
    assert disk.unflushed == []


CHANGES: dict[str, Callable[[Store], Any]] = {
    "extend": lambda store: store.extend(MORE),
    "adopt": lambda store: store.adopt(small_sweep("run.workers=3")),
    "reduce": lambda store: store.write_reduction({"a": (("k",), [1])}, {}),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_kill_between_the_root_and_its_copy_leaves_a_store_that_opens(
    change: str, filled: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, renamed = os.replace, []

    def dying(source: Path, target: Path) -> None:
        if Path(target).parent == filled.path:
            renamed.append(Path(target).name)
            if len(renamed) == 2:
                raise Killed
        replace(source, target)

    before = (filled.path / "zarr.json").read_bytes()
    monkeypatch.setattr(os, "replace", dying)
    with pytest.raises(Killed):
        CHANGES[change](filled)
    monkeypatch.undo()
    assert renamed == ["zarr.json.copy", "zarr.json"]
    assert Store.open(filled.path).metadata == filled.metadata
    assert (filled.path / "zarr.json").read_bytes() == before
    with xr.open_zarr(filled.path, chunks=None) as data:
        assert data.sizes["point"] == 15
    CHANGES[change](Store.open(filled.path))
    assert Store.open(filled.path).metadata != filled.metadata
