"""Files that are whole or absent, also after a crash.

A file is written under a temporary name in its own folder, flushed to the disk, and renamed. The
folder is flushed last. A reader therefore sees either the old contents or the new ones. After a
power failure, a file exists only if all files written before it exist too.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import uuid
from collections.abc import Iterator, Sequence
from pathlib import Path

from chimera_hpc.base.processes import is_gone, process_identity

HOPELESS = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM)
"""Errors that the next write would also raise."""
_SUFFIX = ".partial"
LEFTOVER_AGE = 3600.0
"""Age (s) at which a temporary file of an unknown process is treated as left over."""


def temporary_name(path: Path) -> Path:
    """Return a new name in the folder of `path` that contains the identity of this process."""
    return path.with_name(f".{path.name}.{process_identity()}.{uuid.uuid4().hex[:8]}{_SUFFIX}")


def write_atomically(path: Path, data: bytes) -> None:
    """Replace or create `path` with `data`. On return, name and contents are on the disk."""
    write_together([(path, data)])


def write_together(contents: Sequence[tuple[Path, bytes]]) -> None:
    """Write several files in order, as `write_atomically` does, but flush them together.

    On return, all of them are on the disk. After a crash, only the first few may be.
    """
    with contextlib.ExitStack() as stack:
        files = [stack.enter_context(_written(path, data)) for path, data in contents]
        for temporary, _ in files:
            _flush(temporary)
        for temporary, path in files:
            os.replace(temporary, path)
    for folder in dict.fromkeys(path.parent for path, _ in contents):
        sync_folder(folder)


def create_exclusively(path: Path, data: bytes, *, durable: bool = True) -> bool:
    """Create `path` with `data` unless it exists; return whether this call created it.

    Unless `durable`, the file may be lost in a power failure.

    The complete contents are hard-linked into place, so a reader never finds the file empty. The
    file server itself makes or refuses a link, also on network file systems where an exclusive
    open is unreliable. If the server's answer is lost, the repeated request is refused although
    the first one succeeded. The link count of the temporary file detects this case. Without hard
    links, the file is opened exclusively.
    """
    with _written(path, data) as (temporary, _):
        if durable:
            _flush(temporary)
        try:
            os.link(temporary, path)
        except FileExistsError:
            created = temporary.stat().st_nlink == 2
        except OSError as error:
            if error.errno not in (errno.EPERM, errno.ENOTSUP, errno.EMLINK, errno.ENOSYS):
                raise
            created = _open_exclusively(path, data)
        else:
            created = True
    if durable:
        sync_folder(path.parent)
    return created


def sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to the disk."""
    _flush(folder)


def sync_tree(folder: Path) -> None:
    """Flush every file and folder below and including `folder` to the disk."""
    for place, _, names in os.walk(folder):
        for name in names:
            _flush(Path(place, name))
        _flush(Path(place))


def remove_leftovers(folder: Path) -> int:
    """Delete the temporary files and folders that killed writers left in `folder`.

    A temporary file or folder is left over when its process ran on this machine and has ended, or
    when it has not changed for `LEFTOVER_AGE`. Returns the number of deleted entries.
    """
    with contextlib.suppress(FileNotFoundError):
        found = list(folder.glob(f".*{_SUFFIX}"))
        now = time_at(folder) if found else 0.0
        left = [path for path in found if is_leftover(path, now)]
        for path in left:
            _remove(path)
        return len(left)
    return 0


def is_leftover(path: Path, now: float) -> bool:
    """Return whether the writer of a temporary file or folder has abandoned it.

    `now` is the time of the file server's clock (see `time_at`).
    """
    mark = path.name.removesuffix(_SUFFIX).rpartition(".")[0].rpartition(".")[2]
    try:
        age = now - path.stat().st_mtime
    except FileNotFoundError:
        return False
    return is_gone(mark) or age > LEFTOVER_AGE


def server_time(folder: Path) -> float:
    """Return the current time of the clock that stamps the files of `folder` (s since 1970).

    The clocks of hosts that share a folder may differ. The age of a file is measured with this
    clock.
    """
    probe = temporary_name(folder / "clock")
    probe.touch()
    try:
        return probe.stat().st_mtime
    finally:
        probe.unlink(missing_ok=True)


def time_at(folder: Path) -> float:
    """Return `server_time` or, if nothing can be written, the latest time of a file in `folder`.

    This machine's own clock is never used: if it is fast, files in use would seem old. The latest
    time of a file is never later than the server's, so no file seems older than it is.
    """
    try:
        return server_time(folder)
    except OSError:
        return max((_modified(path) for path in folder.glob("*")), default=0.0)


def _modified(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


@contextlib.contextmanager
def _written(path: Path, data: bytes) -> Iterator[tuple[Path, Path]]:
    """Yield a temporary file with the data and its final path. Delete the file on exit."""
    temporary = temporary_name(path)
    try:
        with temporary.open("xb") as file:
            file.write(data)
        yield temporary, path
    finally:
        temporary.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _open_exclusively(path: Path, data: bytes) -> bool:
    try:
        with path.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except FileExistsError:
        return False
    return True
