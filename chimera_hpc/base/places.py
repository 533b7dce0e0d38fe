"""Folders for a user's own files: the home folder or, if it cannot be used, a substitute."""

from __future__ import annotations

import getpass
import os
import stat
import tempfile
from pathlib import Path


def home_folder() -> Path:
    """Return the user's home folder, or a substitute if there is none.

    A container with a bare user id has no home folder. ``$HOME`` is then set to the substitute,
    because other packages, such as Bokeh, cannot be imported without it.
    """
    try:
        return Path.home()
    except RuntimeError:
        os.environ["HOME"] = str(private_folder())
        return Path.home()


def private_folder() -> Path:
    """Return a folder for temporary files that is the same for all processes of this user.

    Raises OSError: it cannot be made, or another user has made it.
    """
    folder = Path(tempfile.gettempdir()) / f"chimera_hpc-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    # Any user can create this name in /tmp. Files that others can write must not be executed.
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
        raise PermissionError(13, "is not a folder of this user alone", str(folder))
    return folder


def is_writable(folder: Path) -> bool:
    """Return whether files can be created in `folder`, which is created if it does not exist."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def prepare_home() -> None:
    """Provide a home folder for other packages, and a folder for matplotlib's list of fonts.

    If matplotlib cannot write to its own folder, it warns and searches for all fonts again in each
    process. Call this function before matplotlib is imported.
    """
    home = home_folder()
    if "MPLCONFIGDIR" in os.environ:
        return
    for variable, name in (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache")):
        base = os.environ.get(variable) or home / name
        if not is_writable(Path(base) / "matplotlib"):
            os.environ["MPLCONFIGDIR"] = str(private_folder() / "matplotlib")
            return


def user_name() -> str:
    """Return the user's name, or the user id if it has no name."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):
        return str(os.getuid())
