"""The memory of the machine, or of the container or batch job that this process runs in."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

_CGROUPS = Path("/sys/fs/cgroup")
_MEMBERSHIP = Path("/proc/self/cgroup")


def usable_memory() -> int:
    """Return the bytes of memory that this process and its children may use together.

    The memory of the machine, or the smallest limit of the control groups (versions 1 and 2) that
    this process is in.
    """
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return min([machine, *_limits()])


def share_of_memory(workers: int) -> int:
    """Return the bytes of each of so many workers."""
    return usable_memory() // max(1, workers)


def _limits() -> Iterator[int]:
    for file in _limit_files():
        try:
            yield int(file.read_text())
        except (OSError, ValueError):
            # No such file, or "max".
            continue


def _limit_files() -> Iterator[Path]:
    """Yield the files with the limits of this process's groups and of all groups above them."""
    try:
        lines = _MEMBERSHIP.read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            root, name = _CGROUPS, "memory.max"
        elif "memory" in controllers.split(","):
            root, name = _CGROUPS / "memory", "memory.limit_in_bytes"
        else:
            continue
        group = root / path.lstrip("/")
        yield from (folder / name for folder in (group, *group.parents) if root in folder.parents)
        yield root / name
