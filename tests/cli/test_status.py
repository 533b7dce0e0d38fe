"""``status``: counts, rate and the map of cells, of sweeps in every state."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from store_tools import block_results, make_store

from chimera_hpc.base.status import Status
from chimera_hpc.cli.cell_map import Cells, draw, letters_of
from chimera_hpc.cli.status import recent_rate
from chimera_hpc.reduction.reduction import reduce_sweep
from chimera_hpc.store.claims import claim_block
from chimera_hpc.store.ledger import read_metadata, scan_ledger
from chimera_hpc.store.store import Store

Run = Callable[..., tuple[int, str, str]]
PLANE = ("P=2:5", "Q=0:P", "seeds=2", "reduction.figures=[]")


def filled(folder: Path, *overrides: str, blocks: int | None = None) -> Store:
    """Fill the first blocks of the small store."""
    store = make_store(folder, *overrides)
    for block in range(store.n_blocks if blocks is None else blocks):
        store.write_block(block, block_results(store, block), 1, 1)
    return store


def fail(store: Store, block: int) -> None:
    store.write_block(block, block_results(store, block, Status.TIME_OUT), 1, 1)


def map_text(store: Store, width: int = 80, height: int = 40, plain: bool = False) -> list[str]:
    cells = Cells.read(store.path, read_metadata(store.path))
    assert cells is not None
    text = draw(cells, store.ledger()["status"], width, height, plain).plain
    return [line.rstrip() for line in text.splitlines()]


def test_counts_are_told_with_the_sentence_of_each_outcome(tmp_path: Path, sweep: Run) -> None:
    store = filled(tmp_path, blocks=2)
    fail(store, 2)
    code, out, _ = sweep("status", tmp_path)
    assert code == 75
    lines = out.splitlines()
    assert lines[0] == "small: 8 of 15 points done (53.3 %)"
    assert lines[1].split()[:2] == ["8", "done:"]
    assert lines[2].split()[:2] == ["4", "time-out:"]
    assert lines[3].split() == ["3", "never", "run"]


def test_json_is_one_object_without_a_map(tmp_path: Path, sweep: Run) -> None:
    filled(tmp_path, blocks=1)
    code, out, _ = sweep("status", tmp_path, "--json")
    state = json.loads(out)
    assert code == 75
    assert (state["points"], state["done"], state["pending"], state["failed"]) == (15, 4, 11, 0)
    assert state["statuses"] == {"done": 4, "never": 11}
    assert state["points_a_second"] is None
    assert state["seconds_left"] is None


def test_map_tells_done_part_failed_and_pending_cells(tmp_path: Path) -> None:
    # Blocks of 4 over cells of 5 seeds: the first cell is whole, the second in part.
    store = filled(tmp_path, blocks=2)
    assert map_text(store)[:2] == ["P = Q", " ●  ◐  ·"]
    fail(store, 3)
    assert map_text(store)[:2] == ["P = Q", " ●  ◐  ✗"]
    assert map_text(store)[-1] == "● done   ◐ in part   ✗ some failed"
    assert map_text(store, plain=True)[1] == " #  +  !"


def test_map_over_two_axes_has_the_second_upwards(tmp_path: Path) -> None:
    assert map_text(filled(tmp_path, *PLANE))[:8] == [
        "Q",
        "5           ●",
        "4        ●  ●",
        "3     ●  ●  ●",
        "2  ●  ●  ●  ●",
        "1  ●  ●  ●  ●",
        "0  ●  ●  ●  ●",
        "   2  3  4  5  P",
    ]


def test_map_has_the_classes_of_the_results_small_while_runs_are_to_come(tmp_path: Path) -> None:
    store = filled(tmp_path, "reduction.figures=[]", blocks=2)
    reduce_sweep(tmp_path)
    classes = json.loads((tmp_path / "results.json").read_text())["cuts"]["3"]["cells"]
    first, second = (cell["class"][0] for cell in classes[:2])
    expected = f" {first.upper()}  {second.lower()}  ·"
    assert map_text(store)[1] == expected
    assert "small letter" in map_text(store)[-1]


def test_letters_are_different() -> None:
    names = ["ordered", "chimera-1", "chimera-2", "clustered", "other"]
    letters = letters_of(names)
    assert letters["ordered"] == "O"
    assert len(set(letters.values())) == len(names)


@pytest.mark.parametrize("width", [30, 80, 120])
def test_map_keeps_to_its_width_and_height(tmp_path: Path, width: int) -> None:
    store = make_store(tmp_path, "n_nodes=200", "P=3:90", "Q=0:P", "seeds=1", "keep.series='none'")
    fail(store, 500)
    lines = map_text(store, width, 20)
    *rows, heads, note, empty, _ = lines
    assert max(map(len, rows)) <= width
    assert len(heads) <= width + len("  P")
    assert len(rows) <= 20 + len(["Q"])
    assert note.startswith("each sign stands for ")
    assert empty == ""
    assert sum(row.count("✗") for row in rows) >= 1


def test_long_axis_is_wrapped(tmp_path: Path) -> None:
    axis = "epsilon = {linspace = [0.01, 0.1, 150]}"
    store = filled(tmp_path, "P=3", "Q=P", axis.replace(" = ", "=", 1), "seeds=1")
    lines = map_text(store, 60)
    assert lines[0] == "epsilon"
    assert lines[1].startswith("●●●")
    assert lines[2].startswith("0.01")  # each line of cells is over their values
    assert max(map(len, lines)) <= 60
    assert sum(line.count("●") for line in lines[:-1]) == 150


def test_more_axes_give_a_map_for_each_value(tmp_path: Path) -> None:
    store = filled(tmp_path, "P=2:3", "Q=[0,1]", "epsilon=[0.05,0.06,0.07,0.08,0.09]", "seeds=1")
    lines = map_text(store)
    assert [line for line in lines if line.startswith("epsilon")] == [
        f"epsilon = 0.0{n}" for n in (5, 6, 7, 8)
    ]
    assert "and 1 more such maps" in lines


def test_extended_store_has_all_its_cells(tmp_path: Path) -> None:
    from store_tools import small_sweep

    store = filled(tmp_path).extend(small_sweep("P=2:5"))
    assert map_text(store)[1:3] == [" ●  ●  ●  ·", " 2  3  4  5"]


def test_colours_only_on_a_terminal_that_wants_them(finished: Path) -> None:
    def shown(**environment: str) -> str:
        command = [sys.executable, "-m", "chimera_hpc.sweep", "status", str(finished)]
        clean = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
        done = subprocess.run(command, capture_output=True, env=clean | environment, check=True)
        return done.stdout.decode()

    assert "\x1b[" not in shown()
    assert "\x1b[" in shown(FORCE_COLOR="1", TERM="xterm-256color")


def test_damaged_results_leave_the_map_without_classes(finished: Path, sweep: Run) -> None:
    for text in ("", "[]", '{"cuts": {}}', '{"cuts": {"3": {"cells": [{}]}}}'):
        (finished / "results.json").write_text(text)
        code, out, error = sweep("status", finished)
        assert (code, error) == (0, "")
        assert "●  ●  ●" in out


def test_rate_counts_back_to_the_last_pause(tmp_path: Path) -> None:
    store = filled(tmp_path, "seeds=20", "run.block=5")
    now = time.time()
    scan = scan_ledger(store.path)
    scan.columns["elapsed_us"][:] = 2_000_000
    for block in range(12):
        # Two hours ago, then one block every 10 s, the last one just now.
        at = now - 7200 + block if block < 4 else now - 10 * (11 - block)
        os.utime(store.path / "ledger" / f"c.{block}.0", (at, at))
    assert recent_rate(store.path, scan, 5) == pytest.approx(5 * 8 / 80, rel=0.05)


def test_rate_falls_when_nothing_comes_any_more(tmp_path: Path) -> None:
    store = filled(tmp_path)
    scan = scan_ledger(store.path)
    scan.columns["elapsed_us"][:] = 1_000_000
    for block in range(store.n_blocks):
        at = time.time() - 1000 + block
        os.utime(store.path / "ledger" / f"c.{block}.0", (at, at))
    assert recent_rate(store.path, scan, 4) == pytest.approx(15 / 1004, rel=0.05)


def test_time_to_go_is_told_while_somebody_works(tmp_path: Path, sweep: Run) -> None:
    store = filled(tmp_path, blocks=2)
    assert claim_block(store.path, 2, 1) is not None
    _, out, _ = sweep("status", tmp_path)
    assert "points per second now, about" in out
    state = json.loads(sweep("status", tmp_path, "--json")[1])
    assert state["seconds_left"] == pytest.approx(7 / state["points_a_second"])


def test_large_sweep_is_told_without_a_map(tmp_path: Path, sweep: Run, monkeypatch) -> None:
    filled(tmp_path)
    monkeypatch.setattr("chimera_hpc.cli.cell_map.MOST_POINTS", 10)
    _, out, _ = sweep("status", tmp_path)
    assert "●" not in out
    assert "15 of 15 points done" in out


def test_status_and_watch_load_nothing_heavy(finished: Path) -> None:
    code = (
        "import sys\nfrom chimera_hpc.sweep import main\n"
        f"main(['status', {str(finished)!r}])\nmain(['watch', {str(finished)!r}])\n"
        "heavy = {'zarr', 'numba', 'scipy', 'sklearn', 'matplotlib', 'dask', 'bokeh', 'xarray'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_map_of_many_cells_is_quick(tmp_path: Path) -> None:
    store = make_store(tmp_path, "n_nodes=500", "P=3:200", "Q=0:P", "seeds=9", "run.block=5000")
    cells = Cells.read(store.path, read_metadata(store.path))
    assert cells is not None
    seconds = []
    for _ in range(3):
        began = time.process_time()
        draw(cells, np.full(store.n_points, int(Status.DONE)), 120, 40)
        seconds.append(time.process_time() - began)
    # 0.3 s; on a core that another program shares, two or three times as much.
    assert min(seconds) < 2.0


def test_neither_jobs_nor_models_are_loaded(tmp_path: Path) -> None:
    filled(tmp_path, blocks=1)
    code = "import sys; from chimera_hpc.cli.main import main; "
    code += "main(['status', sys.argv[1], '--json']); "
    code += "print(*{'pydantic', 'numba', 'chimera_hpc.job'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path], check=True, capture_output=True, text=True
    )
    assert done.stdout.splitlines()[1] == ""
