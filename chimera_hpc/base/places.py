"""Where a user's own files may lie: the home folder and, where that is of no use, a stand-in."""

from __future__ import annotations

import getpass
import os
import stat
import tempfile
from pathlib import Path


def home_folder() -> Path:
    """Return the user's home; without one, as in a container with a bare user id, a stand-in.

    Then ``$HOME`` is set: other packages, such as Bokeh, cannot be imported without it.
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
    # Anybody may make this name in /tmp: what others can write is not to be executed.
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
        raise PermissionError(13, "is not a folder of this user alone", str(folder))
    return folder


def is_writable(folder: Path) -> bool:
    """Return whether files can be made in `folder`, which is made if it does not exist."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def prepare_home() -> None:
    """See to it that other packages find a home folder, and matplotlib one for its list of fonts.

    Where its own folder cannot be written, matplotlib would warn, and look for all fonts again in
    each process. To be called before it is imported.
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
    """Return the user's name, or the number of a user without one."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):
        return str(os.getuid())
