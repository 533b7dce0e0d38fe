"""The table of faults: what is run, what is done to it, how it must end, what may be lost.

For developers: a fault is a row of `TABLE`. `allowed` is how many points may be computed again: a
block for each process that was killed or stopped, and each damaged block. What fits into no kind of
row is a `Story`, a function of a trial that returns `trial.finding(allowed)`.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lab import BLOCK, LOCAL, N_BLOCKS, PATIENCE, SERIAL, Child, Finding, Point, Trial

BROKEN: Point = (3, 5)
"""The point that is made to fail."""
PLACES: tuple[str, ...] = ()
"""Stands for `Trial.places`: worker processes and the driver's own, by turns."""


class Impossible(RuntimeError):
    """This machine, or this user, does not allow the fault."""


@dataclass(frozen=True)
class Strike:
    """Something happens to a run at a random moment."""

    name: str
    options: tuple[str, ...]
    """Of the run."""
    action: Callable[[Trial, Child], object]
    exits: int | tuple[int, ...]
    """Exit statuses that it may have."""
    allowed: int

    @property
    def by_turns(self) -> bool:
        return self.options == PLACES

    def __call__(self, trial: Trial) -> Finding:
        child = trial.start_run(*(self.options or trial.places))
        trial.wait_for_a_moment(child)
        self.action(trial, child)
        trial.ended(child, self.exits)
        trial.resume()
        return trial.finding(self.allowed)


@dataclass(frozen=True)
class Surroundings:
    """A run has a machine about it that lacks something."""

    name: str
    options: tuple[str, ...]
    around: Callable[[Trial], contextlib.AbstractContextManager[dict[str, str]]]
    """What is wrong while it runs; gives its environment."""
    by_turns = False

    def __call__(self, trial: Trial) -> Finding:
        with self.around(trial) as environment:
            child = trial.start_run(*self.options, **environment)
            trial.ended(child, 0)
        trial.resume()
        return trial.finding(0)


@dataclass(frozen=True)
class Culprit:
    """One point misbehaves, and must be the only one that fails."""

    name: str
    kind: str
    """See `trouble`."""
    options: tuple[str, ...] = SERIAL
    deaths: int = 0
    """Processes that it takes with it."""
    said: str = ""
    """In the list of failures."""

    @property
    def by_turns(self) -> bool:
        return self.options == PLACES

    def __call__(self, trial: Trial) -> Finding:
        trouble = f"{self.kind}:{BROKEN[0]}:{BROKEN[1]}"
        child = trial.start_run(*(self.options or trial.places), TROUBLE=trouble)
        trial.ended(child, 1)
        trial.expect_failures(child.text(), BROKEN)
        if self.said not in child.text():
            trial.problems.append(f"not said to be {self.said}")
        sets = [w for w in self.options if w.startswith(("--set", "integrator.", "run."))]
        text = trial.resume(*sets, expect=1, TROUBLE=trouble)
        trial.expect_failures(text, BROKEN)
        return trial.finding(self.deaths * BLOCK, broken=(BROKEN,))


@dataclass(frozen=True)
class Damage:
    """Something happens to the store of a sweep that is done."""

    name: str
    action: Callable[[Trial], object]
    allowed: int
    by_turns = False

    def __call__(self, trial: Trial) -> Finding:
        _copy_reference(trial)
        self.action(trial)
        trial.resume()
        return trial.finding(self.allowed, was_whole=True)


@dataclass(frozen=True)
class Story:
    """Anything else."""

    name: str
    action: Callable[[Trial], Finding]
    by_turns: bool = False
    """Whether an even trial and an odd one are two different things."""

    def __call__(self, trial: Trial) -> Finding:
        return self.action(trial)


def _kill_a_worker(trial: Trial, child: Child) -> None:
    _kill(trial.random.sample(child.workers(), min(1, len(child.workers()))))


def _interrupt_twice(trial: Trial, child: Child) -> None:
    child.signal_group(signal.SIGINT)
    time.sleep(trial.random.uniform(0, 0.1))
    child.signal_group(signal.SIGINT)


def _stop_a_worker_for_a_while(trial: Trial, child: Child) -> None:
    worker = child.workers()[:1]
    _signal(worker, signal.SIGSTOP)
    time.sleep(trial.random.uniform(0, 2 * PATIENCE))
    _signal(worker, signal.SIGCONT)


def _sent(number: int) -> Callable[[Trial, Child], object]:
    return lambda _, run: run.signal(number)


def _sent_to_all(number: int) -> Callable[[Trial, Child], object]:
    return lambda _, run: run.signal_group(number)


def hang_driver_for_a_while(trial: Trial) -> Finding:
    first = trial.start_run(*SERIAL)
    trial.wait_for_a_moment(first)
    first.signal(signal.SIGSTOP)
    second = trial.start_run(*SERIAL)
    trial.ended(second, 0)
    first.signal(signal.SIGCONT)
    trial.ended(first, 0)
    trial.resume()
    return trial.finding(BLOCK)


def two_drivers(trial: Trial) -> Finding:
    drivers = [trial.start_run(*SERIAL)]
    time.sleep(trial.random.uniform(0, 0.5))
    drivers.append(trial.start_run(*trial.places))
    for driver in drivers:
        trial.ended(driver, 0)
    trial.resume()
    return trial.finding(0)


def skewed_clocks(trial: Trial) -> Finding:
    drivers = [
        trial.start_run(*options, SKEW=skew)
        for options, skew in ((LOCAL, "0"), (SERIAL, "3700"), (SERIAL, "-3700"))
    ]
    for driver in drivers:
        trial.ended(driver, 0)
    trial.resume(SKEW="3700")
    return trial.finding(0)


@contextmanager
def _full_tmp(trial: Trial) -> Iterator[dict[str, str]]:
    """Have a temporary folder without room for a byte."""
    folder = trial.folder / "tmp"
    with _mounted(folder, "-t", "tmpfs", "-o", "size=64k", "tmpfs"):
        with contextlib.suppress(OSError), (folder / "ballast").open("wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        yield {"TMPDIR": str(folder), "FRESH": "1"}


@contextmanager
def _read_only_home(trial: Trial) -> Iterator[dict[str, str]]:
    """Have a home where nothing can be written, and no other place for compiled kernels."""
    folder = trial.folder / "home"
    with _mounted(folder, "-t", "tmpfs", "-o", "ro", "tmpfs"):
        places = ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "NUMBA_CACHE_DIR", "MPLCONFIGDIR")
        # All trials share the stand-in for the kernels, as all runs of a machine do.
        shared = trial.folder.parent / "stand-in"
        shared.mkdir(exist_ok=True)
        empty = dict.fromkeys(places, "")
        yield {"HOME": str(folder), "TMPDIR": str(shared), "FRESH": "1", **empty}


def kill_scheduler(trial: Trial) -> Finding:
    file = trial.folder / "scheduler.json"
    with _scheduler(trial, file) as first:
        options = ("--cluster", "scheduler-file", "--scheduler-file", str(file))
        # Time enough for another scheduler to start.
        child = trial.start_run(*options, "--set", "run.patience=30")
        trial.wait_for_a_moment(child)
        first[0].kill()
        if trial.number % 2:
            trial.ended(child, (75, 0))
        else:
            with _scheduler(trial, file):
                trial.ended(child, 0)
    trial.resume()
    return trial.finding(2 * BLOCK)


def _cut_short(trial: Trial) -> None:
    chunk = _some_chunk(trial)
    os.truncate(chunk, trial.random.randrange(chunk.stat().st_size))


def _flip_a_byte(trial: Trial) -> None:
    chunk = _some_chunk(trial)
    _flip(trial, chunk)
    text = trial.run("verify", trial.out, "--stored", "--forget", expect=1)
    if chunk.parent.name not in text:
        trial.problems.append(f"{chunk} not named: {text}")


def _lose_a_ledger_chunk(trial: Trial) -> None:
    (trial.store / "ledger" / f"c.{trial.random.randrange(N_BLOCKS)}.0").unlink()


# Another model than that of the results


def weight_changed(trial: Trial) -> Finding:
    file = trial.folder / "weight.txt"
    file.write_text("1.0")
    _stop_half_way(trial, TROUBLE_WEIGHT=str(file))
    file.write_text("1.5")
    _expect_refusal(trial, "trouble.WEIGHT: 1.0 before, 1.5 now", TROUBLE_WEIGHT=str(file))
    file.write_text("1.0")
    trial.resume(TROUBLE_WEIGHT=str(file))
    return trial.finding(2 * BLOCK)


def two_modules(trial: Trial) -> Finding:
    _stop_half_way(trial)
    other = trial.folder / "trouble.py"
    other.write_text((Path(__file__).parent / "trouble.py").read_text() + "# edited\n")
    _expect_refusal(trial, "two different files may be meant")
    other.unlink()
    trial.resume()
    return trial.finding(2 * BLOCK)


def _stop_half_way(trial: Trial, **environment: str) -> None:
    child = trial.start_run(*trial.places, **environment)
    trial.wait_for_a_moment(child)
    child.signal(signal.SIGTERM)
    trial.ended(child, (75, 0))


def _expect_refusal(trial: Trial, words: str, **environment: str) -> None:
    """Go on with --strict: one line, unless nothing was left to do and the model is the same."""
    left = trial.blocks_done() < N_BLOCKS or not environment
    text = trial.resume("--strict", expect=2 if left else 0, **environment)
    errors = [line for line in text.splitlines() if line.startswith("error: ")]
    if left and not (len(errors) == 1 and words in errors[0]):
        trial.problems.append(f"not refused in one line: {text[-400:]}")


# Disks


def disk_full(trial: Trial) -> Finding:
    with _mounted(trial.out, "-t", "tmpfs", "-o", "size=8m", "tmpfs"):
        child = trial.start_run(*trial.places)
        trial.wait_for_a_moment(child)
        ballast = trial.out / "ballast"
        with contextlib.suppress(OSError), ballast.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        code = trial.ended(child, (75, 0))
        if code == 75 and "No space left on device" not in child.text():
            trial.problems.append(f"no clear line: {child.text()[-300:]}")
        ballast.unlink()
        trial.resume()
        return trial.finding(2 * BLOCK)


def read_only(trial: Trial) -> Finding:
    child = trial.start_run(*trial.places)
    trial.wait_for(trial.blocks_done, child)
    with _mounted(trial.store, "--bind", str(trial.store)):
        # Open files still lead to the folder below; the names lead to this mount.
        trial.wait_for_a_moment(child)
        _remount(trial, child)
        code = trial.ended(child, (75, 0, 2))
        if code and "Read-only file system" not in child.text():
            trial.problems.append(f"no clear line: {child.text()[-300:]}")
        # Nothing to be repaired there.
        trial.run("status", trial.out, expect=75 if code else 0)
    trial.resume()
    return trial.finding(2 * BLOCK)


# Damage


def left_over(trial: Trial) -> Finding:
    child = trial.start_run(*SERIAL)
    trial.wait_for_a_moment(child)
    child.signal(signal.SIGKILL)
    trial.ended(child, (-9, 0))
    mark = _mark_of_the_dead()
    for folder in ("", "u", "features", "scalars", "quality", "ledger", "claims", "runs"):
        (trial.store / folder / f".c.0.{mark}.0123abcd.partial").write_bytes(b"part")
    (trial.out / f".store.zarr.{mark}.0123abcd.partial").mkdir()
    trial.resume()
    return trial.finding(BLOCK)


def attributes_damaged(trial: Trial) -> Finding:
    _copy_reference(trial)
    files = [trial.store / "zarr.json"] * 3
    files += [trial.store / name / "zarr.json" for name in ("u", "features", "ledger", "seed")]
    files += [trial.store / "seed" / "c.0", trial.store / "P" / "c.0"]
    file = trial.random.choice(files)
    harm = trial.random.randrange(4)
    if harm == 0:
        file.unlink()
    elif harm == 1:
        os.truncate(file, trial.random.randrange(file.stat().st_size))
    elif harm == 2:
        file.write_bytes(trial.random.randbytes(100))
    else:
        _flip(trial, file)
    trial.resume()
    if _metadata(trial.store) != _metadata(_reference_store(trial)):
        trial.problems.append(f"{file}: the metadata are not those of before")
    return trial.finding(0, was_whole=True)


# Kills in the middle of other commands


def kill_plan(trial: Trial) -> Finding:
    child = trial.start_run(*SERIAL)
    folder = trial.wait_for(lambda: list(trial.folder.glob("sweep/.store*")), child)
    time.sleep(trial.random.uniform(0, 0.15) if folder else 0)
    child.signal(signal.SIGKILL)
    trial.ended(child, -9)
    trial.resume()
    return trial.finding(BLOCK)


def kill_extend(trial: Trial) -> Finding:
    trial.resume("--set", "seeds=6")
    extend = ("extend", trial.job, "--out", trial.out)
    child = trial.start(*extend)
    claim = trial.store / "claims" / "metadata.1.json"
    trial.wait_for(claim.exists, child)
    time.sleep(trial.random.uniform(0, 0.2))
    child.signal(signal.SIGKILL)
    trial.ended(child, (-9, 0))
    trial.run(*extend)
    trial.resume()
    return trial.finding(0)


def kill_merge(trial: Trial) -> Finding:
    parts = []
    for name, seeds in (("first", "[0,1,2,3,4]"), ("second", "[3,4,5,6,7]")):
        parts.append(trial.folder / name)
        run = ("run", trial.job, "--out", parts[-1], "--no-figures", *SERIAL)
        trial.run(*run, "--set", f"seeds={seeds}", TROUBLE_LOG="")
    merge = ("merge", *parts, "--out", trial.out)
    child = trial.start(*merge)
    trial.wait_for(lambda: list(trial.folder.glob("sweep/.store*")), child)
    time.sleep(trial.random.uniform(0, 0.3))
    child.signal(signal.SIGKILL)
    trial.ended(child, (-9, 0))
    if not trial.store.exists():
        trial.run(*merge)
    trial.run("reduce", trial.out, "--no-figures")
    trial.run("verify", trial.out, "--stored")
    return trial.finding(0)


def kill_reduce(trial: Trial) -> Finding:
    _copy_reference(trial)
    wanted = (trial.out / "results.json").read_bytes()
    child = trial.start("reduce", trial.out, "--no-figures")
    claim = trial.store / "claims" / "metadata.1.json"
    trial.wait_for(claim.exists, child)
    time.sleep(trial.random.uniform(0, 0.15))
    child.signal(signal.SIGKILL)
    trial.ended(child, (-9, 0))
    trial.run("reduce", trial.out, "--no-figures")
    if (trial.out / "results.json").read_bytes() != wanted:
        trial.problems.append("another results.json")
    trial.resume()
    return trial.finding(0, was_whole=True)


def _kill(pids: list[int]) -> None:
    _signal(pids, signal.SIGKILL)


def _signal(pids: list[int], number: int) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def _reference_store(trial: Trial) -> Path:
    return trial.folder.parent / "reference" / "sweep" / "store.zarr"


def _copy_reference(trial: Trial) -> None:
    """Begin with the folder of the undisturbed run."""
    shutil.copytree(_reference_store(trial).parent, trial.out)


def _some_chunk(trial: Trial) -> Path:
    array = trial.random.choice(["u", "features", "scalars", "quality", "ledger"])
    return trial.random.choice(sorted((trial.store / array).glob("c.*")))


def _flip(trial: Trial, file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[trial.random.randrange(len(data))] ^= 1 << trial.random.randrange(8)
    file.write_bytes(data)


def _metadata(store: Path) -> dict[str, Any]:
    """Return what the files say that tell what the store is."""
    names = ["zarr.json", *(f"{n}/zarr.json" for n in ("u", "features", "ledger", "seed", "P"))]
    return {name: json.loads((store / name).read_bytes()) for name in names}


def _mark_of_the_dead() -> str:
    """Return the mark of a process of this machine that is gone."""
    from chimera_hpc.base.processes import process_identity

    machine, _, rest = process_identity().partition("-")
    return f"{machine}-{os.getpid()}-{int(rest.partition('-')[2]) + 1}"


@contextmanager
def _mounted(folder: Path, *how: str) -> Iterator[None]:
    """Mount something at a folder."""
    if os.geteuid() != 0 or shutil.which("mount") is None:
        raise Impossible("only root may mount")
    folder.mkdir(exist_ok=True)
    done = subprocess.run(["mount", *how, str(folder)], capture_output=True, check=False)
    if done.returncode:
        raise Impossible(done.stderr.decode().strip())
    try:
        yield
    finally:
        for _ in range(100):
            if subprocess.run(["umount", str(folder)], capture_output=True, check=False).returncode:
                time.sleep(0.05)
            else:
                break


def _remount(trial: Trial, child: Child) -> None:
    """Make the mount at the store read-only as soon as no file in it is open for writing."""
    command = ["mount", "-o", "remount,ro,bind", str(trial.store)]
    for _ in range(2000):
        if subprocess.run(command, capture_output=True, check=False).returncode == 0:
            return
        if child.poll() is not None:
            return
    trial.problems.append("could not be made read-only")


@contextmanager
def _scheduler(trial: Trial, file: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run a Dask scheduler and two workers, as `dask scheduler` and `dask worker` do."""
    file.unlink(missing_ok=True)
    module = [sys.executable, "-m", "distributed.cli"]
    log = (trial.folder / "dask.txt").open("ab")
    scheduler = f"{module[2]}.dask_scheduler", "--host", "127.0.0.1", "--port", "0"
    worker = f"{module[2]}.dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard"
    options = ("--no-dashboard", "--scheduler-file", str(file))
    environment = os.environ | {"TROUBLE_LOG": str(trial.log), "TROUBLE_SECONDS": "0.03"}
    processes: list[subprocess.Popen[bytes]] = []

    def start(*words: str) -> None:
        command = [*module[:2], *words]
        processes.append(
            subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=trial.folder)
        )

    try:
        start(*scheduler, *options)
        trial.wait_for(file.exists)
        for _ in range(2):
            start(*worker, "--scheduler-file", str(file))
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.wait()
        log.close()


# A point on a crowded machine needs seconds.
_HANG = (*("--set", "integrator.time_out=15"), *("--set", "run.patience=5"))
TABLE: tuple[Strike | Surroundings | Culprit | Damage | Story, ...] = (
    # Processes that die
    Strike("kill -9 of a worker", LOCAL, _kill_a_worker, 0, BLOCK),
    Strike("kill -9 of all workers", LOCAL, lambda _, run: _kill(run.workers()), 0, 2 * BLOCK),
    Strike("kill -9 of the driver", PLACES, _sent(signal.SIGKILL), (-9, 0), 2 * BLOCK),
    Strike("SIGTERM", PLACES, _sent(signal.SIGTERM), (75, 0), 2 * BLOCK),
    Strike("Ctrl-C once", PLACES, _sent_to_all(signal.SIGINT), (130, 0), 2 * BLOCK),
    Strike("Ctrl-C twice", PLACES, _interrupt_twice, (130, 0), 2 * BLOCK),
    Strike("SIGSTOP of a worker, never continued", LOCAL,
           lambda _, run: _signal(run.workers()[:1], signal.SIGSTOP), 0, BLOCK),
    Strike("SIGSTOP of a worker, late awakening", LOCAL, _stop_a_worker_for_a_while, 0, BLOCK),
    Story("SIGSTOP of a driver, late awakening", hang_driver_for_a_while),
    Story("two drivers at once", two_drivers, by_turns=True),
    Story("three drivers, their clocks an hour apart", skewed_clocks),
    Story("kill -9 of the scheduler", kill_scheduler, by_turns=True),
    # Points that misbehave
    Culprit("a point that never ends", "forever", (*SERIAL, "--set", "integrator.time_out=3")),
    Culprit("a point that diverges", "blow-up"),
    # Twice with its block, twice alone; or once with its block, and once or twice alone.
    Culprit("a point that kills its worker every time", "kill", LOCAL, 4, "worker lost"),
    Culprit("a point that needs more memory than there is", "memory",
            (*LOCAL, "--mem", "700M"), 3, "out of memory"),
    Culprit("a right-hand side that never returns, in a worker", "hang", (*LOCAL, *_HANG), 2,
            "time-out: the model did not return"),
    Culprit("a right-hand side that never returns, in one process", "hang", (*SERIAL, *_HANG), 2,
            "time-out: the model did not return"),
    # Disks
    Story("disk full", disk_full, by_turns=True),
    Story("store read-only half-way", read_only),
    Surroundings("full /tmp", LOCAL, _full_tmp),
    Surroundings("read-only home", LOCAL, _read_only_home),
    # Damage
    Damage("a chunk cut short", _cut_short, BLOCK),
    Damage("a byte flipped", _flip_a_byte, BLOCK),
    Damage("a ledger chunk lost", _lose_a_ledger_chunk, BLOCK),
    Story("partial files left over", left_over),
    Story("attributes damaged", attributes_damaged),
    # Another model than that of the results
    Story("a changed weight file", weight_changed, by_turns=True),
    Story("two candidate modules", two_modules, by_turns=True),
    # Kills in the middle of other commands
    Story("kill -9 during plan", kill_plan),
    Story("kill -9 during extend", kill_extend),
    Story("kill -9 during merge", kill_merge),
    Story("kill -9 during reduce", kill_reduce),
)  # fmt: skip
FAULTS = {row.name: row for row in TABLE}
