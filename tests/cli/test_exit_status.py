"""Exit status 1 wherever something is not as it should be, 75 where points are pending."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from chimera_hpc.base.exits import Exit
from chimera_hpc.job import Points, Sweep
from chimera_hpc.run import work
from chimera_hpc.run.block import run_block
from chimera_hpc.store.block_result import BlockResult
from chimera_hpc.store.store import Store

Run = Callable[..., tuple[int, str, str]]
SERIAL = ("--cluster", "serial", "--no-figures")


def flip(path: Path, place: int = 40) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize("options", [(), ("--stored", "--sample", "0.2")])
def test_verify_fails_for_damage_though_the_sample_is_sound(
    options: tuple[str, ...], finished: Path, sweep: Run
) -> None:
    flip(finished / "store.zarr" / "u" / "c.1.0.0")
    code, out, _ = sweep("verify", finished, *options)
    assert "1 chunks damaged" in out
    assert " points recomputed, 0 different" in out
    assert code == 1


def test_run_fails_when_damage_outlives_all_repairs(
    job: Path, finished: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunk = finished / "store.zarr" / "scalars" / "c.1.0"
    repaired = []

    def breaking(*args: Any, **options: Any) -> BlockResult:
        repaired.append(len(args[1]))
        return run_block(*args, **options)

    flip(chunk)
    monkeypatch.setattr(work, "run_block", breaking)
    # Whatever is written, a disk that fails gives back something else.
    read = Path.read_bytes
    monkeypatch.setattr(
        Path, "read_bytes", lambda path: read(path)[:-1] if path == chunk else read(path)
    )
    code, out, _ = sweep("run", job, "--out", finished, *SERIAL)
    assert repaired == [4, 4, 4]
    assert "\nblock 1, scalars: " in out
    assert code == 1


def test_share_of_an_array_fails_when_a_block_was_put_aside(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(sweep: Sweep, points: Points, should_stop: Any = None) -> BlockResult:
        if ((points.columns["seed"] == 4) & (points.columns["P"] == 3)).any():
            raise LookupError("no such thing")
        return run_block(sweep, points)

    monkeypatch.setattr(work, "run_block", run)
    words = ["shard", job, "--out", tmp_path / "out", "--of", "2", "--index"]
    code, out, _ = sweep(*words, 0)
    assert "block 2 could not be done: " in out
    assert code == 1
    # The other share has nothing to do with that block.
    assert sweep(*words, 1)[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "shard"])
def test_points_that_were_added_during_a_run_are_pending(
    command: str, job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    options = SERIAL if command == "run" else ("--of", "1", "--index", "0")
    words = (command, job, "--out", out, *options)

    def extending(*args: Any, **options: Any) -> BlockResult:
        Store.open(out / "store.zarr").extend(Sweep.load(job, ["seeds=7"]))
        return run_block(*args, **options)

    monkeypatch.setattr(work, "run_block", extending)
    code, said, _ = sweep(*words)
    assert code == 75
    assert "5 points were added meanwhile" in said
    assert sweep("status", out)[0] == 75
    monkeypatch.undo()
    assert sweep(*words)[0] == 0
    assert sweep("status", out)[0] == sweep("watch", out)[0] == 0


def test_pending_points_outweigh_failed_ones() -> None:
    assert Exit.of_points(1, 1) is Exit.of_points(1, 0) is Exit.MORE_TO_DO
    assert Exit.of_points(0, 1) is Exit.FAILURES
    assert Exit.of_points(0, 0) is Exit.COMPLETE
