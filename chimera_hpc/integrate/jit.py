"""Compilation of all kernels: strict IEEE arithmetic, no GIL, a cache that is never stale.

numba's on-disk cache depends on the file of the compiled function only. If a kernel calls a
function of another file and that file is edited, numba does not compile the kernel again. Here the
name of the cache folder is a digest of all source files that hold kernels, so an edit of any of
them starts a new folder.

numba is loaded when the first kernel is declared. The path of the cache is known without it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import shutil
import tempfile
import uuid
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).resolve().parent.parent
_KERNEL_FOLDERS = ("integrate", "models", "measures", "classify")
_UNUSED_DAYS = 30
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
    user's cache folder, or in a temporary folder if that one is not writable. Folders of other
    sources next to it are removed if no process has used them for `_UNUSED_DAYS` days.
    """
    base = os.environ.get("NUMBA_CACHE_DIR")
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    root = Path(base) if base else Path(home) / "chimera_hpc" / "numba"
    folder = root / source_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            os.utime(folder)
            _remove_unused(root, before=os.stat(folder).st_mtime - _UNUSED_DAYS * 86400)
            return str(folder)
    except OSError:
        pass
    return tempfile.mkdtemp(prefix="chimera_hpc-numba-")


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
