"""Every part of ``scripts/bench`` runs at its smallest size; no time is judged here."""

from __future__ import annotations

import importlib
import itertools
import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import psutil
import pytest

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch):
    """A module of the benchmark by its name."""
    monkeypatch.syspath_prepend(str(FOLDER))
    return importlib.import_module


@pytest.mark.timeout(900)
@pytest.mark.slow
def test_every_part_runs_and_leaves_a_page(tmp_path):
    (tmp_path / "images").mkdir()
    out = tmp_path / "rows.json"
    words = ["--tiny", "--write", "--docs", str(tmp_path), "--json", str(out)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests")))}
    command = [sys.executable, str(FOLDER / "__main__.py"), *words, "--folder", str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = json.loads(out.read_text())
    assert len(rows) == 19 + bool(find_spec("xgi"))
    assert all(np.isfinite(row["value"]) for row in rows)
    assert "10 million points" in (tmp_path / "performance.md").read_text()
    for name in ("performance", "scaling"):
        assert (tmp_path / "images" / f"{name}.png").stat().st_size > 10_000


def test_peers_solve_the_same_problem(bench):
    problems, peers, single = map(bench, ("problems", "peers", "single"))
    ring = problems.Ring(4, t_end=3.0)
    reference = ring.reference(0, 3.0)
    for u in (
        peers.scipy_full(ring, 0, 1e-8),
        peers.scipy_reduced(ring, 0, 1e-8),
        single.one(ring, 0, 1e-8),
    ):
        assert problems.error(u, reference) < 1e-5


def test_slow_rounds_change_no_ratio(bench):
    speed = np.array([1.0, 1.0, 1.7, 0.6, 1.7])
    found = bench("measure").typical(np.outer([2.0, 3.0, 6.0], speed))
    assert found == pytest.approx([2.0, 3.0, 6.0])
    # One contender alone disturbed in one round: no more than its median feels.
    spent = np.outer([2.0, 3.0, 6.0], np.ones(5))
    spent[1, 2] = 30.0
    assert bench("measure").typical(spent) == pytest.approx([2.0, 3.0, 6.0])


def test_bare_processes_share_the_pieces(bench, tmp_path):
    bare = bench("bare")
    one, other = bare._left(str(tmp_path), "abcde"), bare._left(str(tmp_path), "abcde")
    assert [next(one), next(other), next(other), *one] == list("abcde")
    assert list(other) == []


def test_a_projection_without_costs_is_ideal(bench):
    projection = bench("projection")
    costs = projection.Costs(0.02, 0.0, 0.0, 0.0)
    found = projection.forecast(costs, 10, 3_000, 1, scheduler=True, spread=0.0)
    assert found.hours * 3600 == pytest.approx(0.02 * 300)
    assert found.efficiency == pytest.approx(1.0)


def test_a_scheduler_too_slow_for_its_cores_sets_the_pace(bench):
    projection = bench("projection")
    costs = projection.Costs(0.001, 0.0, 0.01, 0.0)
    found = projection.forecast(costs, 100, 1_000, 1, scheduler=True, spread=0.0)
    assert found.hours * 3600 == pytest.approx(10.0, rel=0.01)
    assert found.scheduler_load > 0.99


WORK = "import time; end = time.thread_time() + {seconds}\nwhile time.thread_time() < end: pass"


def script(text: str) -> list[str]:
    return [sys.executable, "-c", text]


def test_programs_by_turns_are_charged_for_their_own_turns(bench):
    turns = bench("turns")
    ready = "print('ready', flush=True); input(); "
    long, short = (
        turns.Program([script(ready + WORK.format(seconds=s))], prepares=True) for s in (1.2, 0.4)
    )
    turns.take_turns([long, short], 0.05)
    assert long.seconds >= 1.2
    assert 0.4 <= short.seconds < long.seconds


def test_while_one_program_runs_the_other_stands_still(bench, tmp_path):
    turns = bench("turns")
    tell = "import os, time\nfor _ in range(30): "
    tell += "os.write(os.open({file!r}, os.O_WRONLY | os.O_APPEND | os.O_CREAT), b'{name}'); "
    tell += "time.sleep(0.02)"
    file = tmp_path / "told"
    programs = [turns.Program([script(tell.format(file=str(file), name=n))]) for n in "ab"]
    turns.take_turns(programs, 0.2)
    told = file.read_text()
    assert sorted(told) == ["a"] * 30 + ["b"] * 30
    # Side by side they would alternate with every letter.
    assert sum(x != y for x, y in itertools.pairwise(told)) < 20


def test_processes_of_a_program_change_cores_and_share_none(bench):
    turns = bench("turns")
    cores = sorted(os.sched_getaffinity(0))
    # The second one works in a process of its own, as the worker of a whole command does.
    work = WORK.format(seconds=9)
    nested = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {work!r}])"
    program = turns.Program([script(work), script(nested)])
    kept = []
    try:
        program.run(1.0)
        for _ in range(2):
            program.run(0.1)
            first, second = (process.pid for process in program.processes)
            (worker,) = psutil.Process(second).children()
            assert os.sched_getaffinity(second) == set(cores)
            kept.append([os.sched_getaffinity(pid) for pid in (first, worker.pid)])
    finally:
        program.kill()
    assert all(len(one) == 1 for turn in kept for one in turn)
    if len(cores) > 1:
        assert kept[0][0] != kept[0][1]
        assert kept[0][0] != kept[1][0]


def test_program_that_fails_is_told_and_none_is_left(bench):
    turns = bench("turns")
    fails = turns.Program([script("raise SystemExit('no luck')")])
    waits = turns.Program([script("import time; time.sleep(60)")] * 2)
    with pytest.raises(SystemExit, match="ended with 1: no luck"):
        turns.take_turns([waits, fails], 0.3)
    assert [process.returncode for process in waits.processes] == [-9, -9]
