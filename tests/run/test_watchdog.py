"""Models that never return: noticed by a thread, ended, and the other points go on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from jobs_for_tests import job_text

from chimera_hpc.base.foreign import first_entry, foreign_code
from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.run import watchdog as module
from chimera_hpc.run.watchdog import Watchdog
from chimera_hpc.store.store import Store

HANG = """
from chimera_hpc import OwnModel, Parameter


def rhs(y, dy, p, ints):
    n = ints[0]
    for lane in range(y.shape[1]):
        omega = p[0, lane]
        while omega > 6.5 and y[0, lane] > -0.5 and y[0, lane] < 0.0:
            dy[0, lane] = dy[0, lane] + 1.0
        for i in range(n):
            u, v = y[i, lane], y[n + i, lane]
            s = u * u + v * v
            dy[i, lane] = (1.0 - s) * u - omega * v
            dy[n + i, lane] = (1.0 - s) * v + omega * u


def initial(rng, row, n_nodes):
    state = rng.uniform(0.1, 1.0, (2, n_nodes))
    while row["seed"] == SEED:
        pass
    return state


MODEL = OwnModel(
    rhs, variables=("u", "v"), parameters=(Parameter("omega", float, 6.0, "w"),), n_nodes=12,
    initial=initial,
)
"""
JOB = {
    "name": "hang",
    "model": "hang:MODEL",
    "grid.omega": [6.0, 7.0],
    "grid.seeds": 2,
    "integrator.t_end": 20.0,
    "integrator.t_step": 0.02,
    "integrator.time_out": 1.0,
    "features.start": 10.0,
    "features.n_peaks": 3,
    "features.n_overlap": 1,
    "run.patience": 1.0,
    "run.block": 2,
}


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """Two points that end, and two whose right-hand side does not return."""
    (tmp_path / "hang.py").write_text(HANG.replace("SEED", "-1"))
    path = tmp_path / "hang.toml"
    path.write_text(job_text(JOB))
    return path


def command(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "chimera_hpc.sweep", *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "words",
    [
        ("run", "--cluster", "serial", "--no-figures"),
        ("run", "--cluster", "local", "--workers", "1", "--no-figures"),
        ("shard", "--of", "1", "--index", "0"),
    ],
)
def test_point_that_never_returns_has_timed_out_and_the_others_go_on(
    job: Path, tmp_path: Path, words: tuple[str, ...]
) -> None:
    done = command(words[0], job, "--out", tmp_path / "out", *words[1:])
    said, shard = done.stdout + done.stderr, words[0] == "shard"
    assert done.returncode == 1, said
    ledger = Store.open(tmp_path / "out" / "store.zarr").ledger()
    assert ledger["status"].tolist() == [1, 1, Status.TIME_OUT, Status.TIME_OUT]
    assert ledger["steps"][2:].tolist() == [0, 0]
    for seed in (0, 1):
        assert (f"omega=7.0 seed={seed}: time-out: the model did not return" in said) or shard
    assert "Traceback" not in said
    why = command("why", tmp_path / "out", "omega=7.0", "seed=0").stdout
    assert "time-out: the model did not return" in why
    # With no more points than there are tries for, the same command has nothing left to do.
    assert "nothing to compute" in command("run", job, "--out", tmp_path / "out").stderr


@pytest.mark.slow
@pytest.mark.parametrize("what", ["initial", "rhs"])
def test_model_that_hangs_in_its_first_point_is_told_on_one_line(
    job: Path, tmp_path: Path, what: str
) -> None:
    text = HANG.replace("SEED", "0" if what == "initial" else "-1")
    if what == "rhs":
        text = text.replace("omega > 6.5 and y[0, lane] > -0.5 and y[0, lane] < 0.0", "omega > 0.0")
    (tmp_path / "hang.py").write_text(text)
    done = command("plan", job)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "error: model: hang:MODEL did not return within 2 s (integrator.time_out + run.patience)"
    ]


def short(monkeypatch: pytest.MonkeyPatch, limit: float) -> tuple[Watchdog, threading.Event]:
    """Return a watchdog with a short limit, and what is set when it has noticed something."""
    monkeypatch.setattr(module, "limit_of", lambda sweep: limit)
    monkeypatch.setattr(module, "_LOOK_SECONDS", 0.02)
    dog, noticed = Watchdog(), threading.Event()
    dog.on_hang = lambda text: noticed.set()
    dog.watch(Sweep.from_toml_text(job_text({"name": "x", "model": "topological_fhn",
                                             "grid.P": "2:4", "grid.Q": "P"})))  # fmt: skip
    return dog, noticed


def test_call_that_takes_too_long_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    _, noticed = short(monkeypatch, 0.2)
    with foreign_code():
        assert noticed.wait(30)


def test_many_short_calls_are_not_one_long_call(monkeypatch: pytest.MonkeyPatch) -> None:
    dog, noticed = short(monkeypatch, 5.0)
    until = time.monotonic() + 0.3
    while time.monotonic() < until:
        with foreign_code():
            time.sleep(0.001)
    assert not noticed.is_set()
    assert first_entry() is None
    assert dog is not module.watchdog


@pytest.mark.slow
def test_time_in_which_the_process_was_stopped_does_not_count(tmp_path: Path) -> None:
    code = """
import time
from chimera_hpc.base.foreign import foreign_code
from chimera_hpc.run import watchdog
watchdog.limit_of = lambda sweep: 3.0
watchdog.watchdog.on_hang = lambda text: print("hangs", flush=True)
watchdog.watchdog.watch(None)
with foreign_code():
    print("in", flush=True)
    input()
"""
    words = [sys.executable, "-c", code]
    with subprocess.Popen(words, stdin=-1, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "in\n"
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(5)
        os.kill(process.pid, signal.SIGCONT)
        time.sleep(0.3)  # It looks once more.
        said, _ = process.communicate("\n")
    assert said == ""


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 75)])
def test_signal_that_a_model_lets_nobody_take_ends_the_process_after_a_while(
    number: int, status: int
) -> None:
    code = """
import signal, types
from chimera_hpc.base.foreign import foreign_code
from chimera_hpc.run import watchdog
watchdog.limit_of, watchdog._LOOK_SECONDS, watchdog._GRACE_SECONDS = lambda sweep: 99.0, 0.05, 0.2
signal.signal(signal.SIGINT, print)
signal.signal(signal.SIGTERM, print)
watchdog.watchdog.listen()
watchdog.watchdog.on_stop = lambda: print("given back", flush=True)
watchdog.watchdog.watch(types.SimpleNamespace(model="mine:MODEL"))
with foreign_code():
    print("in", flush=True)
    while True:
        input()
"""
    words = [sys.executable, "-c", code]
    with subprocess.Popen(words, stdin=-1, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "in\n"
        process.send_signal(number)
        # The program's end of its input would end it, too.
        assert process.wait(60) == status
        said, error = process.stdout.read(), process.stderr.read() if process.stderr else ""
    assert said.endswith("given back\n")
    assert error == "stopped: mine:MODEL does not return; the same command goes on\n"


def test_forked_process_knows_no_call_of_another_thread() -> None:
    with foreign_code():
        pid = os.fork()
        if not pid:
            os._exit(0 if first_entry() is None else 1)
        assert os.waitpid(pid, 0)[1] == 0
