"""Programs that are measured by turns: while one runs, the others stand still.

A machine that changes its speed within seconds, as virtual ones do, changes it for all of them.
Its cores may differ for minutes, so that with every turn each process goes to another one.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import IO

import psutil


class Program:
    """Processes that run and stand still together.

    Parameters
    ----------
    commands : sequence of command lines
    share : float
        Length of its turns, in units of what `take_turns` is given.
    prepares : bool
        Whether each process says a line when it is ready, and begins when it is told one; what it
        does before is not measured.
    """

    def __init__(
        self, commands: Sequence[list[str]], share: float = 1.0, prepares: bool = False
    ) -> None:
        self.commands, self.share, self.prepares = commands, share, prepares
        self.processes: list[subprocess.Popen[str]] = []
        self.seconds = 0.0
        """How long it has run."""
        self._begun = False
        self._turns = 0

    def prepare(self) -> None:
        """Have it get ready, alone on the machine."""
        if self.prepares:
            self._start()
            for process in self.processes:
                _stream(process.stdout).readline()

    def run(self, seconds: float) -> bool:
        """Let it run so long, and return whether it has ended; raise SystemExit where it failed."""
        _change_cores([process.pid for process in self.processes], self._turns)
        self._turns += 1
        began = time.perf_counter()
        if self._begun:
            os.killpg(self._group(), signal.SIGCONT)
        else:
            self._begin()
        ended = self._wait(began + seconds)
        if not ended:
            os.killpg(self._group(), signal.SIGSTOP)
        self.seconds += time.perf_counter() - began
        return ended

    def kill(self) -> None:
        """End all of it, standing or running."""
        if self.processes:
            with suppress(ProcessLookupError):
                os.killpg(self._group(), signal.SIGKILL)
        for process in self.processes:
            process.wait()
            for stream in (process.stdin, process.stdout, process.stderr):
                if stream is not None:
                    stream.close()

    def _begin(self) -> None:
        self._begun = True
        if not self.prepares:
            self._start()
            return
        for process in self.processes:
            stream = _stream(process.stdin)
            stream.write("\n")
            stream.flush()

    def _start(self) -> None:
        for command in self.commands:
            # All in the group of the first one, which others cannot have left before.
            group = self._group() if self.processes else 0
            pipe, none = subprocess.PIPE, subprocess.DEVNULL
            output = pipe if self.prepares else none
            self.processes.append(
                subprocess.Popen(
                    command, stdin=pipe, stdout=output, stderr=pipe, text=True, process_group=group
                )
            )

    def _group(self) -> int:
        return self.processes[0].pid

    def _wait(self, until: float) -> bool:
        for process in self.processes:
            try:
                status = process.wait(max(0.0, until - time.perf_counter()))
            except subprocess.TimeoutExpired:
                return False
            if status:
                words, said = " ".join(process.args), _stream(process.stderr).read()
                raise SystemExit(f"{words} ended with {status}: {said}")
        return True


def take_turns(programs: Sequence[Program], turn: float) -> None:
    """Let programs run by turns of so many seconds, each times its share, until all have ended."""
    try:
        for program in programs:
            program.prepare()
        left = list(programs)
        while left:
            left = [program for program in left if not program.run(turn * program.share)]
    finally:
        for program in programs:
            program.kill()


def _change_cores(pids: Sequence[int], turn: int) -> None:
    """Give each process that works a core of its own, the next one with every turn.

    Those that have processes of their own (a driver, a fork server) may be anywhere: they are
    looked on as not working. Of the others those that have worked most get the cores.
    """
    cores = sorted(os.sched_getaffinity(0))
    tree = _tree(pids)
    parents = {parent for _, parent, _ in tree}
    busiest = sorted((-spent, pid) for pid, _, spent in tree if pid not in parents)[: len(cores)]
    own = {pid: k for k, pid in enumerate(sorted(pid for _, pid in busiest))}
    for pid, _, _ in tree:
        _keep_to(pid, [cores[(own[pid] + turn) % len(cores)]] if pid in own else cores)


def _tree(pids: Sequence[int]) -> list[tuple[int, int, float]]:
    """Processes and all of theirs: each one's number, its parent's, and its processor time."""
    found = []
    for pid in pids:
        with suppress(psutil.NoSuchProcess):
            for process in (psutil.Process(pid), *psutil.Process(pid).children(recursive=True)):
                # One that has not been stopped yet may end while it is looked at.
                with suppress(psutil.NoSuchProcess):
                    spent = sum(process.cpu_times()[:2])
                    found.append((process.pid, process.ppid(), spent))
    return found


def _keep_to(pid: int, cores: Sequence[int]) -> None:
    # A call for a process is one for its first thread only.
    with suppress(FileNotFoundError, ProcessLookupError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            os.sched_setaffinity(int(thread), cores)


def _stream(stream: IO[str] | None) -> IO[str]:
    assert stream is not None
    return stream
