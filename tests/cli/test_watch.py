"""``watch``: it shows a sweep until that is done, on a terminal and in a pipe."""

from __future__ import annotations

import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from store_tools import block_results, make_store

from chimera_hpc.base.status import Status
from chimera_hpc.cli.watch import _View

Run = Callable[..., tuple[int, str, str]]
WATCH = [sys.executable, "-m", "chimera_hpc.sweep", "watch", "--every", "0.1"]


def test_finished_sweep_is_told_at_once(finished: Path, sweep: Run) -> None:
    assert sweep("watch", finished) == (0, "small: 15 of 15 points done (100.0 %)\n", "")


def test_failures_give_exit_status_1(tmp_path: Path, sweep: Run) -> None:
    store = make_store(tmp_path)
    for block in range(store.n_blocks):
        store.write_block(block, block_results(store, block, Status.TIME_OUT), 1, 1)
    assert sweep("watch", tmp_path)[0] == 1


def test_pipe_gets_a_line_at_each_change(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    with subprocess.Popen([*WATCH, str(tmp_path)], stdout=subprocess.PIPE, text=True) as watch:
        assert watch.stdout is not None
        counts = []
        for block in range(store.n_blocks):
            counts.append(int(watch.stdout.readline().split()[1]))
            store.write_block(block, block_results(store, block), 1, 1)
        counts.append(int(watch.stdout.readline().split()[1]))
        assert watch.wait(20) == 0
    assert counts == [0, 4, 8, 12, 15]


def test_terminal_is_redrawn_until_ctrl_c(tmp_path: Path) -> None:
    store = make_store(tmp_path)
    leader, follower = pty.openpty()
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "70", "LINES": "24"}
    watch = subprocess.Popen(
        [*WATCH, str(tmp_path)], stdin=follower, stdout=follower, stderr=follower, env=environment
    )
    os.close(follower)
    try:
        _read_until(leader, "0 of 15 points done")
        store.write_block(0, block_results(store, 0), 1, 1)
        # All of the picture: the cell of these points, and what puts it in its place.
        _read_until(leader, "4 of 15 points done", "◐", "\x1b[")
        watch.send_signal(signal.SIGINT)
        assert watch.wait(20) == 130
        # The screen of before is back.
        _read_until(leader, "\x1b[?1049l")
    finally:
        watch.kill()
        watch.wait()
        os.close(leader)


def _read_until(descriptor: int, *words: str, seconds: float = 60.0) -> None:
    """Read what the terminal shows until it has shown all of these words."""
    shown, end = b"", time.monotonic() + seconds
    while missing := [word for word in words if word.encode() not in shown]:
        assert time.monotonic() < end, f"{missing} not in {shown!r}"
        if select.select([descriptor], [], [], 0.2)[0]:
            shown += os.read(descriptor, 65536)


def test_classes_appear_when_the_sweep_is_reduced(tmp_path: Path) -> None:
    from rich.console import Console

    from chimera_hpc.reduction.reduction import reduce_sweep

    store = make_store(tmp_path, "reduction.figures=[]")
    for block in range(store.n_blocks):
        store.write_block(block, block_results(store, block), 1, 1)
    console = Console(width=80, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    view = _View(store.path, console)
    console.print(view.look())
    assert "●  ●  ●" in console.export_text()
    reduce_sweep(tmp_path)
    console.print(view.look())
    assert "●  ●  ●" not in console.export_text()
    console.file.close()
    assert view.over
    assert view.exit_status == 0


@pytest.mark.parametrize("pause", ["0", "-1", "x", "nan", "1e9"])
def test_impossible_pause_is_refused(finished: Path, sweep: Run, pause: str) -> None:
    with pytest.raises(SystemExit) as error:
        sweep("watch", finished, f"--every={pause}")
    assert error.value.code == 2


def test_folder_without_a_store_is_bad_input(tmp_path: Path, sweep: Run) -> None:
    code, _, error = sweep("watch", tmp_path)
    assert code == 2
    assert "holds no store.zarr" in error
