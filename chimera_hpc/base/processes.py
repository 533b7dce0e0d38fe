"""The identity of this process, by which others can tell that it has ended, and its cores."""

from __future__ import annotations

import os
import socket
from functools import lru_cache
from hashlib import blake2b
from pathlib import Path

_PROC = Path("/proc")


def process_identity() -> str:
    """Return ``machine-pid-start`` of this process, unique across reboots and reused process ids.

    The text is valid in a file name. `start` is the start time of the process in clock ticks after
    boot, or 0 on a system without ``/proc``.
    """
    return _mark(os.getpid())


def is_gone(mark: str) -> bool:
    """Return whether a process with this identity ran on this machine and has ended.

    Returns False in doubtful cases: another host, boot or container, or an invalid identity. A
    process that was killed but not yet reaped by its parent has ended.
    """
    machine, _, rest = mark.partition("-")
    pid, _, start = rest.partition("-")
    if machine != _machine() or not (pid.isdecimal() and start.isdecimal()):
        return False
    started = _started(int(pid))
    return started is None or started != int(start)


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@lru_cache(maxsize=1)
def _mark(pid: int) -> str:
    return f"{_machine()}-{pid}-{_started(pid) or 0}"


# A descendant may reuse the process id of an ancestor that has ended.
os.register_at_fork(after_in_child=_mark.cache_clear)


@lru_cache(maxsize=1)
def _machine() -> str:
    """Return a digest of host, boot and namespace: equal where process ids mean the same."""
    parts = [socket.gethostname()]
    try:
        parts.append((_PROC / "sys/kernel/random/boot_id").read_text().strip())
        parts.append(os.readlink(_PROC / "self/ns/pid"))
    except OSError:
        parts.append("no /proc")
    return blake2b("\n".join(parts).encode(), digest_size=4).hexdigest()


def _started(pid: int) -> int | None:
    """Return the start of a process in clock ticks after boot, 0 if unknown, None if it ended."""
    if not (_PROC / "self/stat").exists():
        return 0 if _answers(pid) else None
    try:
        text = (_PROC / str(pid) / "stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    # The command name, in parentheses, may itself contain spaces and parentheses.
    fields = text.rpartition(")")[2].split()
    state, start = fields[0], fields[19]
    return None if state in "ZX" else int(start)


def _answers(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
