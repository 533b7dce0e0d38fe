"""Compilation of all kernels: strict IEEE arithmetic, no GIL, a cache that is never stale.

numba's on-disk cache depends on the file of the compiled function only. If a kernel calls a
function of another file and that file is edited, numba does not compile the kernel again. Here the
name of the cache folder is a digest of all source files that hold kernels, so an edit of any of
them starts a new folder.

numba is loaded when the first kernel is declared. The path of the cache is known without it.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import platform
import re
import shutil
import tempfile
import uuid
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from chimera_hpc.base.places import home_folder, is_writable, private_folder

_PACKAGE = Path(__file__).resolve().parent.parent
_KERNEL_FOLDERS = ("integrate", "models", "measures")
_UNUSED_DAYS = 30
_KERNEL_BYTES = 32_000_000
"""Room for all kernels, which take 11 MB, and for those that replace them."""
_OLD = re.compile(r"[0-9a-f]{16}(\.[0-9a-f]{32}\.old)?")
"""Name of a cache folder, or of one whose removal was interrupted."""


OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
"""Options of every kernel: the GIL is released and division follows NumPy. There is no fast-math
flag, so a sum keeps its order and a NaN stays a NaN. ``_nrt=False`` disables numba's runtime for
memory (see `numba.extending.register_jitable`): a kernel that allocates does not compile, and no
references are counted. With the runtime the stepping loop takes 1.6 times as long."""


@cache
def source_digest() -> str:
    """Digest of the kernels' sources and of the versions that compile them (16 hex digits)."""
    digest = hashlib.blake2b(digest_size=8)
    digest.update(f"{version('numba')} {platform.python_version()}".encode())
    for file in kernel_sources():
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


def kernel_sources() -> list[Path]:
    """Return the source files that hold kernels."""
    return [file for name in _KERNEL_FOLDERS for file in sorted((_PACKAGE / name).glob("*.py"))]


@cache
def cache_folder() -> str:
    """Folder of the compiled kernels.

    It is in ``$NUMBA_CACHE_DIR`` if set (a cluster job sets it to a node-local folder), else in the
    user's cache folder. If no kernels can be written there, it is in the user's `private_folder`,
    and as a last resort in a folder that this process and those that it starts share, and that is
    removed at its end. Folders of other sources next to it are removed if no process has used them
    for `_UNUSED_DAYS` days.
    """
    with contextlib.suppress(OSError):
        for root in _roots():
            folder = root / source_digest()
            if is_writable(folder) and _has_room(folder):
                os.utime(folder)
                _remove_unused(root, before=folder.stat().st_mtime - _UNUSED_DAYS * 86400)
                return str(folder)
    last = tempfile.mkdtemp(prefix="chimera_hpc-numba-")
    os.environ["NUMBA_CACHE_DIR"] = last
    atexit.register(_remove_of, os.getpid(), last)
    (Path(last) / source_digest()).mkdir()
    return str(Path(last) / source_digest())


def _roots() -> Iterator[Path]:
    base = os.environ.get("NUMBA_CACHE_DIR")
    home = os.environ.get("XDG_CACHE_HOME")
    if base:
        yield Path(base)
    else:
        yield (Path(home) if home else home_folder() / ".cache") / "chimera_hpc" / "numba"
    yield private_folder() / "numba"


def _has_room(folder: Path) -> bool:
    """Return whether all kernels fit on the disk, or some were written before."""
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize > _KERNEL_BYTES or any(folder.glob("*/*.nbc"))


def _remove_of(pid: int, folder: str) -> None:
    """Remove a folder at the end of the process that made it, not of one forked from it."""
    if os.getpid() == pid:
        shutil.rmtree(folder, ignore_errors=True)


def _remove_unused(root: Path, before: float) -> None:
    """Remove the folders of other digests that were last used before a time of the file server.

    Each folder is renamed first, so that only one process removes it and no process reads a folder
    that is partly removed.
    """
    for folder in root.iterdir():
        ours = _OLD.fullmatch(folder.name) and folder.name != source_digest()
        with contextlib.suppress(OSError):
            if ours and folder.stat().st_mtime < before:
                doomed = folder.with_name(f"{folder.name.partition('.')[0]}.{uuid.uuid4().hex}.old")
                folder.rename(doomed)
                shutil.rmtree(doomed)


def jit(*signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile as ``numba.njit`` does, with the options of every kernel and the project's cache.

    The options are `OPTIONS`. Compiled code is cached on disk.
    """
    numba = _numba()

    def decorate(function: Callable[..., Any]) -> Any:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = cache_folder()
        try:
            return numba.njit(*signature, cache=True, **OPTIONS, **options)(function)
        finally:
            numba.config.CACHE_DIR = before

    return decorate


def compile_uncached(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile a user's function as `jit` does, but do not cache it on disk.

    The function, or one that it calls, may be edited between two runs.
    """
    return _numba().njit(signature, **OPTIONS)(function)


def _numba() -> Any:
    # Typed loosely: numba's annotations do not know its configuration.
    return import_module("numba")
