"""One trial of the fault harness: a small sweep, real processes, and what is found at the end.

The harness has imported everything, and holds no thread; each command line runs in a process of its
own, forked from it, which calls `chimera_hpc.sweep.main` as ``python -m chimera_hpc.sweep`` does.
So a trial costs tenths of a second and not seconds.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jobs_for_tests import SMALL, job_text

JOB = job_text(
    SMALL,
    {
        "name": "faults",
        "model": "trouble:MODEL",
        "grid.P": "2:5",
        "grid.Q": None,
        "grid.seeds": 8,
        "fixed.n_nodes": None,
        "integrator.time_out": 60.0,
        "reduction.cuts": [3],
        "run.patience": 30.0,
    },
)
N_POINTS, N_BLOCKS, BLOCK = 32, 8, 4
PATIENCE = 30.0
# First and last point of the sweep, and the last one of the sweep before it was extended.
CHECKED = ((2, 0), (5, 7), (5, 5))
POINT_SECONDS = 0.03
_LONGEST = 600.0

Point = tuple[int, int]
"""P and seed."""


@dataclass(eq=False)
class Child:
    """A process that runs one command line."""

    pid: int
    output: Path
    code: int | None = None

    def poll(self) -> int | None:
        """Return the exit status (as subprocess does), None while it runs."""
        if self.code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.code = os.waitstatus_to_exitcode(status)
        return self.code

    def wait(self, seconds: float = _LONGEST) -> int:
        """Return the exit status; a process that does not end is killed and reported."""
        until = time.monotonic() + seconds
        while self.poll() is None:
            if time.monotonic() > until:
                self.signal(signal.SIGKILL)
                self.code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
                raise Stuck(f"did not end in {seconds:.0f} s: {self.text()[-300:]}")
            time.sleep(0.01)
        assert self.code is not None
        return self.code

    def signal(self, number: int) -> None:
        """Send a signal to the process alone."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def signal_group(self, number: int) -> None:
        """Send a signal to the process and its workers, as a terminal does."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, number)

    def workers(self) -> list[int]:
        """Return the process numbers of its Dask workers that live: forked, or spawned."""
        servers = [pid for pid in _children(self.pid) if b"forkserver" in _command(pid)]
        forked = [pid for server in servers for pid in _children(server)]
        return forked or [pid for pid in _children(self.pid) if b"spawn_main" in _command(pid)]

    def text(self) -> str:
        """Return all that it has printed so far."""
        return self.output.read_text(errors="replace")


class Stuck(RuntimeError):
    """A process that should have ended long ago."""


@dataclass
class Finding:
    """What became of the points in one trial."""

    lost: int
    recomputed: int
    allowed: int
    equal: bool
    problems: list[str]

    @property
    def good(self) -> bool:
        held = self.recomputed <= self.allowed and self.equal
        return held and self.lost == 0 and not self.problems


@dataclass
class Trial:
    """The folder of one trial, its processes, and what they may have done wrong."""

    folder: Path
    random: random.Random
    number: int
    reference: dict[Point, dict[str, Any]]
    problems: list[str] = field(default_factory=list)
    children: list[Child] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True)
        self.job = self.folder / "job.toml"
        self.job.write_text(JOB)
        self.out = self.folder / "sweep"
        self.log = self.folder / "begun.log"

    @property
    def store(self) -> Path:
        return self.out / "store.zarr"

    @property
    def places(self) -> tuple[str, ...]:
        """Where the disturbed run works: worker processes and this one, by turns."""
        return LOCAL if self.number % 2 == 0 else SERIAL

    def start(self, *arguments: Any, slow: bool = True, **environment: str) -> Child:
        """Start a command line in a process group of its own."""
        output = self.folder / f"output-{len(self.children)}.txt"
        given = {"TROUBLE_LOG": str(self.log), **environment}
        if slow:
            given["TROUBLE_SECONDS"] = str(POINT_SECONDS)
        child = Child(fork(lambda: command(map(str, arguments)), output, given), output)
        self.children.append(child)
        return child

    def run(self, *arguments: Any, expect: int | tuple[int, ...] = 0, **options: Any) -> str:
        """Run a command line to its end; another exit status than expected is a problem."""
        child = self.start(*arguments, **{"slow": False, **options})
        self.ended(child, expect)
        return child.text()

    def start_run(self, *options: str, **environment: str) -> Child:
        """Start the sweep."""
        return self.start(
            "run", self.job, "--out", self.out, "--no-figures", *options, **environment
        )

    def resume(self, *options: str, expect: int = 0, **environment: str) -> str:
        """Run the sweep to its end, without a disturbance."""
        arguments = ("run", self.job, "--out", self.out, "--no-figures", *SERIAL, *options)
        return self.run(*arguments, expect=expect, **environment)

    def ended(self, child: Child, expect: int | tuple[int, ...]) -> int:
        """Wait for a process; note it as a problem when it ended otherwise than expected."""
        code = child.wait()
        wanted = (expect,) if isinstance(expect, int) else expect
        if code not in wanted:
            self.problems.append(f"exit {code}, not {expect}: {child.text()[-400:]}")
        return code

    def wait_for(self, condition: Callable[[], Any], child: Child | None = None) -> Any:
        """Wait until something is so, or the process has ended; return what was found."""
        until = time.monotonic() + _LONGEST
        while not (found := condition()):
            if (child is not None and child.poll() is not None) or time.monotonic() > until:
                return None
            time.sleep(0.005)
        return found

    def blocks_done(self) -> int:
        """Return how many blocks have a ledger chunk."""
        try:
            return sum(name.startswith("c.") for name in os.listdir(self.store / "ledger"))
        except FileNotFoundError:
            return 0

    def wait_for_a_moment(self, child: Child) -> None:
        """Wait for a random moment between the first block and the last but one."""
        target = self.random.randint(1, N_BLOCKS - 3)
        self.wait_for(lambda: self.blocks_done() >= target, child)
        time.sleep(self.random.uniform(0, BLOCK * POINT_SECONDS))

    def finding(
        self, allowed: int, broken: tuple[Point, ...] = (), was_whole: bool = False
    ) -> Finding:
        """Compare the store with that of an undisturbed run.

        `allowed` is how many points may have been begun more than once (or at all, when the store
        `was_whole` before); `broken` are the points that must have failed, all others must have a
        result.
        """
        for child in self.children:
            if "Traceback (most recent call last)" in child.text():
                self.problems.append(f"a traceback: {child.text()[-400:]}")
        found = read_points(self.store, self.folder)
        wanted = {point for point in self.reference if point not in broken}
        lost = sum(found.get(point, {}).get("status", 255) > 3 for point in wanted)
        equal = all(same(found.get(point), self.reference[point]) for point in wanted)
        for point in broken:
            if not 4 <= found.get(point, {}).get("status", 255) <= 9:
                self.problems.append(f"{point} should have failed: {found.get(point)}")
        left = [*self.store.glob("claims/*.json"), *self.store.rglob("*.partial")]
        if left:
            self.problems.append(f"left over: {[path.name for path in left]}")
        again = self.recomputed(broken, 0 if was_whole else 1)
        return Finding(lost, again, allowed, equal, self.problems)

    def recomputed(self, broken: tuple[Point, ...], needed: int) -> int:
        """Count how often points were begun beyond what was needed.

        Points that processes build to check the model and to warm up are left out, and so are those
        that were made to fail.
        """
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        begun = Counter(tuple(map(int, line.split())) for line in lines)
        others = {point: n for point, n in begun.items() if point not in {*CHECKED, *broken}}
        return sum(n - needed for n in others.values())

    def failures_listed(self, text: str) -> set[Point]:
        """Return the points in the list of failures that a run has printed."""
        found = set()
        for line in text.partition("points failed:")[2].splitlines():
            words = dict(w.split("=") for w in line.partition(":")[0].split() if "=" in w)
            if words.keys() == {"P", "seed"}:
                found.add((int(words["P"]), int(words["seed"])))
        return found

    def expect_failures(self, text: str, *points: Point) -> None:
        """Note it as a problem when the list of failures is not exactly this."""
        if self.failures_listed(text) != set(points):
            self.problems.append(f"listed as failed: {self.failures_listed(text)}: {text[-400:]}")

    def end(self) -> None:
        """See to it that no process is left."""
        for child in self.children:
            if child.poll() is None:
                child.signal_group(signal.SIGCONT)
                child.signal_group(signal.SIGKILL)
                with contextlib.suppress(ChildProcessError):
                    os.waitpid(child.pid, 0)


SERIAL = ("--cluster", "serial")
LOCAL = ("--cluster", "local", "--workers", "2")


def command(arguments: Iterator[str]) -> int:
    """Run a command line in this process."""
    program = [sys.executable, "-m", "chimera_hpc.sweep", *arguments]
    if os.environ.pop("FRESH", ""):
        # Nothing is imported or compiled yet, and the folders are those of the environment.
        for name in [name for name, value in os.environ.items() if not value]:
            del os.environ[name]
        os.execv(sys.executable, program)
    from chimera_hpc.sweep import main

    ahead, now = float(os.environ.get("SKEW", "0")), time.time
    if ahead:
        time.time = lambda: now() + ahead
    return int(main(program[3:], program))


def fork(work: Callable[[], int], output: Path, environment: dict[str, str]) -> int:
    """Do some work in a process of its own; its number is that of its process group."""
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid:
        with contextlib.suppress(PermissionError, ProcessLookupError):
            os.setpgid(pid, pid)
        return pid
    code = 70
    try:
        os.setpgid(0, 0)
        target = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(target, 1)
        os.dup2(target, 2)
        os.environ.update(environment)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = work()
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 70
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def read_points(store: Path, folder: Path) -> dict[Point, dict[str, Any]]:
    """Return what is on the disk for each point; in another process, for Zarr starts threads."""
    target = folder / "points.json"
    target.unlink(missing_ok=True)
    child = Child(fork(lambda: _write_points(store, target), folder / "reading.txt", {}), target)
    if child.wait() != 0:
        return {}
    return {(p["P"], p["seed"]): p for p in json.loads(target.read_text())}


def same(found: dict[str, Any] | None, wanted: dict[str, Any]) -> bool:
    """Whether a point has the same status, and the same bytes of results and series."""
    keys = ("status", "digest", "stored", "series")
    return found is not None and all(found[key] == wanted[key] for key in keys)


def _write_points(store: Path, target: Path) -> int:
    """Decode every chunk, and compute all digests from the bytes on the disk."""
    from hashlib import blake2b

    from chimera_hpc.store.ledger import digests
    from chimera_hpc.store.store import Store

    opened = Store.open(store)
    ledger, columns = opened.ledger(), opened.points.columns
    rows = []
    for block in range(opened.n_blocks):
        start, stop = opened.block(block)
        try:
            chunks = {name: opened.files.read(name, block) for name in opened.files.shapes}
        except Exception as error:
            # The points of the block count as lost.
            sys.stderr.write(f"{error}\n")
            continue
        stored = digests(chunks["features"], chunks["scalars"])
        for i in range(start, stop):
            series = blake2b(chunks["u"][i - start].tobytes(), digest_size=8).hexdigest()
            rows.append(
                {
                    **{name: int(columns[name][i]) for name in ("P", "seed")},
                    **{name: int(ledger[name][i]) for name in ("status", "attempts", "run")},
                    "digest": int(ledger["digest"][i]),
                    "stored": int(stored[i - start]),
                    "series": series,
                }
            )
    target.write_text(json.dumps(rows))
    return 0


def _children(pid: int) -> list[int]:
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            with contextlib.suppress(OSError, IndexError):
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
                if int(fields[1]) == pid and fields[0] != "Z":
                    found.append(int(folder.name))
    return found


def _command(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""
