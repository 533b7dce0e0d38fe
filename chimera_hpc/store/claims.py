"""Which process works on which block: one claim file per attempt; many processes share a store.

The file of attempt k on block i is ``claims/<i>.<k>.json`` inside the store. The block belongs to
the highest attempt present. A process claims a block by creating the next file exclusively. If many
processes find a block free, or a claim expired, exactly one gets it. There is no lock that could go
stale (`flock` is not dependable on network file systems), and files are never moved, so that no
process can remove a claim that is newer than its last check. The file exists before the work
begins: a block that kills its worker every time leaves a file each time, and its next owner sees
them all in `Claim.lost`.

A claim is alive while its file's modification time, the heartbeat, is younger than `expiry` by the
file server's own clock. A claim whose process is gone from this very machine is free at once.
`Claim.release` removes the files of a block from the lowest attempt to the highest, so that the
highest is there until the last moment.

Between the last look at a claim and the write of the ledger a process may be stopped for longer
than `expiry`. Then two owners write the same block, each file whole, and both write the same bits:
a point's results depend on the point only.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
import time
import uuid
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chimera_hpc.base.files import create_exclusively, server_time, time_at
from chimera_hpc.base.processes import is_gone, process_identity

FOLDER = "claims"
EXPIRY = 60.0
"""Seconds without a heartbeat after which a claim is free; kernels return to Python every 0.5 s."""
_HANDED_BACK, _OUT_OF_MEMORY, _NO_RETURN = 0, 1, 2
"""Heartbeats, long expired, that tell the next owner why the last one ended."""
_NAME = re.compile(r"(?P<block>\w+)\.(?P<attempt>[1-9]\d*)\.json", re.ASCII)


class ClaimLost(RuntimeError):
    """The block now has another owner, who will write it."""


@dataclass(frozen=True)
class LostAttempt:
    """An earlier claim of a block that never came to its end."""

    attempt: int
    """Which attempt it was, from 1."""
    handed_back: bool
    """Whether its owner could still record that it gave up; otherwise the process was lost."""
    out_of_memory: bool
    """Whether its owner could still record that it was ended for its use of memory."""
    no_return: bool
    """Whether its owner could still record that a call of the model did not return."""
    info: Mapping[str, Any]
    """The contents of the claim file; empty when unreadable."""


@dataclass
class Claim:
    """The right to write one block: kept alive by `refresh`, ended by `release` or `hand_back`."""

    path: Path
    block: int | str
    attempts: int
    """Attempts on this block since it was last written, this one included."""
    token: str
    lost: tuple[LostAttempt, ...] = ()
    """The earlier attempts, oldest first."""
    expiry: float = EXPIRY
    _refreshed: float = field(default_factory=time.monotonic)

    def refresh(self) -> bool:
        """Renew the heartbeat, return whether the claim is still ours; cheap enough for every step.

        The file is touched at most five times within `expiry`.
        """
        if time.monotonic() - self._refreshed < self.expiry / 5:
            return True
        if not self.still_mine():
            return False
        with contextlib.suppress(FileNotFoundError):
            os.utime(self.path)
        self._refreshed = time.monotonic()
        return True

    def still_mine(self) -> bool:
        """Whether no other process took the block. Checked again before the ledger is written."""
        if max(_attempts(self.path.parent, self.block), default=0) != self.attempts:
            return False
        return _read(self.path).get("token") == self.token

    def release(self) -> None:
        """End the claim of a block that was written, or that had nothing left to do."""
        if not self.still_mine():
            return
        for attempt in sorted(_attempts(self.path.parent, self.block)):
            _path(self.path.parent, self.block, attempt).unlink(missing_ok=True)

    def hand_back(self) -> None:
        """Let others take the block at once; the attempt stays counted."""
        if self.still_mine():
            os.utime(self.path, (_HANDED_BACK, _HANDED_BACK))

    def blame_memory(self) -> None:
        """Record that this process is being ended because it uses too much memory."""
        with contextlib.suppress(OSError):
            os.utime(self.path, (_OUT_OF_MEMORY, _OUT_OF_MEMORY))

    def blame_model(self) -> None:
        """Record that this process is being ended because the model does not return."""
        with contextlib.suppress(OSError):
            os.utime(self.path, (_NO_RETURN, _NO_RETURN))


def claim_block(
    store: Path,
    block: int | str,
    run: int,
    *,
    expiry: float = EXPIRY,
    note: Mapping[str, Any] | None = None,
) -> Claim | None:
    """Claim a block of a store, or return None where another runner holds it.

    block: its number, or a word for something else that only one may do at a time.
    expiry: seconds without `Claim.refresh` after which others may take over.
    note: what the next owner should know if this one dies, such as the first point to be done.

    After a successful claim, look again at what is left to do: the block may have been finished
    between the look at the ledger and the claim.
    """
    folder = Path(store) / FOLDER
    folder.mkdir(exist_ok=True)
    present = sorted(_attempts(folder, block))
    if present and not _is_free(_path(folder, block, present[-1]), server_time(folder)):
        return None
    attempt = present[-1] + 1 if present else 1
    token = uuid.uuid4().hex
    path = _path(folder, block, attempt)
    content = _content(block, run, attempt, token, expiry, note)
    # No process outlasts a loss of power, so its claims need not either.
    if not create_exclusively(path, content, durable=False):
        return None
    if max(_attempts(folder, block), default=attempt) > attempt:
        # The listing above was behind the times: the block had gone through other hands meanwhile.
        path.unlink(missing_ok=True)
        return None
    lost = tuple(_lost(folder, block, earlier) for earlier in present)
    return Claim(path, block, attempt, token, lost, expiry)


def live_claims(store: Path) -> dict[int, Mapping[str, Any]]:
    """Return the contents of the claim file of every block that is being worked on."""
    return {block: _read(path) for block, path, free in _highest(Path(store) / FOLDER) if not free}


def remove_stale(store: Path, blocks: Collection[int]) -> int:
    """Delete what is left of the claims on these finished blocks; return how many there were.

    Their owners died after the ledger was written and before the release. Blocks in work
    keep their claims.
    """
    folder = Path(store) / FOLDER
    stale = [block for block, _, free in _highest(folder) if free and block in blocks]
    for block in stale:
        for attempt in sorted(_attempts(folder, block)):
            _path(folder, block, attempt).unlink(missing_ok=True)
    return len(stale)


def forget_points(store: Path, block: int) -> None:
    """Delete the claims ``<block>_<row>`` on single points of a block that is finished."""
    folder = Path(store) / FOLDER
    for match in map(_NAME.fullmatch, _names(folder)):
        if match and match["block"].startswith(f"{block}_"):
            (folder / match[0]).unlink(missing_ok=True)


def _highest(folder: Path) -> list[tuple[int, Path, bool]]:
    """Return the claimed blocks, the file of the highest attempt, and whether that is free."""
    highest: dict[int, int] = {}
    for match in map(_NAME.fullmatch, _names(folder)):
        if match and match["block"].isdecimal():
            block, attempt = int(match["block"]), int(match["attempt"])
            highest[block] = max(highest.get(block, 0), attempt)
    now = time_at(folder) if highest else 0.0
    paths = {block: _path(folder, block, attempt) for block, attempt in sorted(highest.items())}
    return [(block, path, _is_free(path, now)) for block, path in paths.items()]


def _content(
    block: int | str,
    run: int,
    attempt: int,
    token: str,
    expiry: float,
    note: Mapping[str, Any] | None,
) -> bytes:
    info = {
        "block": block,
        "run": run,
        "attempt": attempt,
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "process": process_identity(),
        "since": time.time(),
        "expiry": expiry,
        "token": token,
        "note": dict(note or {}),
    }
    return json.dumps(info).encode()


def _is_free(path: Path, now: float) -> bool:
    try:
        heartbeat = path.stat().st_mtime
    except FileNotFoundError:
        return True
    info = _read(path)
    expiry = info.get("expiry")
    limit = float(expiry) if isinstance(expiry, int | float) else EXPIRY
    return now - heartbeat > limit or is_gone(str(info.get("process", "")))


def _lost(folder: Path, block: int | str, attempt: int) -> LostAttempt:
    path = _path(folder, block, attempt)
    try:
        word = path.stat().st_mtime
    except FileNotFoundError:
        word = -1.0
    return LostAttempt(
        attempt,
        handed_back=word == _HANDED_BACK,
        out_of_memory=word == _OUT_OF_MEMORY,
        no_return=word == _NO_RETURN,
        info=_read(path),
    )


def _read(path: Path) -> dict[str, Any]:
    """Return the contents of a claim file, or nothing where it is gone or unreadable."""
    try:
        info = json.loads(path.read_bytes())
    except (FileNotFoundError, ValueError):
        return {}
    return info if isinstance(info, dict) else {}


def _attempts(folder: Path, block: int | str) -> list[int]:
    matches = map(_NAME.fullmatch, _names(folder))
    return [int(m["attempt"]) for m in matches if m and m["block"] == str(block)]


def _names(folder: Path) -> list[str]:
    try:
        return os.listdir(folder)
    except FileNotFoundError:
        return []


def _path(folder: Path, block: int | str, attempt: int) -> Path:
    return folder / f"{block}.{attempt}.json"
