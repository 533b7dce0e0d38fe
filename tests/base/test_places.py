"""Folders of a user whose home is unknown or cannot be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from chimera_hpc.base import places

NOWHERE = "/proc/nowhere"
"""No one, not even root, can make a folder there."""
CACHE = "from chimera_hpc.integrate.jit import cache_folder; print(cache_folder())"
STRANGER = ("unshare", "--user", "--map-user=12345", "--map-group=12345")
"""Runs a command under a user id that no list of users has."""


def run(code: str, *before: str, **environment: str | None) -> str:
    wanted = {k: v for k, v in (os.environ | environment).items() if v is not None}
    words = [*before, sys.executable, "-c", code]
    return subprocess.run(
        words, env=wanted, capture_output=True, text=True, check=True
    ).stdout.strip()


def test_unwritable_cache_of_kernels_has_one_stand_in_for_all_runs(tmp_path: Path) -> None:
    places = {"NUMBA_CACHE_DIR": NOWHERE, "TMPDIR": str(tmp_path)}
    first, second = (run(CACHE, **places) for _ in range(2))
    assert first == second
    assert Path(first).parent == tmp_path / f"chimera_hpc-{os.getuid()}" / "numba"
    assert [path.name for path in tmp_path.iterdir()] == [f"chimera_hpc-{os.getuid()}"]


def test_stand_in_that_others_can_write_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / f"chimera_hpc-{os.getuid()}"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for mode in (0o720, 0o702, 0o777):
        folder.chmod(mode)
        with pytest.raises(PermissionError):
            places.private_folder()
    # Its kernels are shared with the processes that are started, and go with the process.
    code = f"{CACHE}; import subprocess, sys; subprocess.run([sys.executable, '-c', '''{CACHE}'''])"
    said = run(code, NUMBA_CACHE_DIR=NOWHERE, TMPDIR=str(tmp_path)).splitlines()
    assert len(said) == 2
    assert len(set(said)) == 1
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


@pytest.mark.skipif(
    shutil.which("unshare") is None
    or subprocess.run([*STRANGER, "true"], capture_output=True, check=False).returncode != 0,
    reason="no user namespaces",
)
def test_user_without_name_and_home_has_a_home(tmp_path: Path) -> None:
    code = """
from pathlib import Path
from chimera_hpc.base.places import prepare_home, user_name
from chimera_hpc.run.slurm import options, tls
prepare_home()
print(Path.home(), user_name(), tls.home(), options.user_file(), sep="\\n")
import matplotlib
"""
    none = dict.fromkeys(("HOME", "USER", "LOGNAME", "LNAME", "USERNAME", "XDG_CONFIG_HOME"))
    home, name, private, config = run(code, *STRANGER, TMPDIR=str(tmp_path), **none).splitlines()
    assert home == str(tmp_path / "chimera_hpc-12345")
    assert name == "12345"
    assert private.startswith(home)
    assert config.startswith(home)


def test_unwritable_home_makes_matplotlib_use_the_stand_in(tmp_path: Path) -> None:
    code = """
import os
from chimera_hpc.base.places import prepare_home
prepare_home()
print(os.environ["MPLCONFIGDIR"])
"""
    unset = dict.fromkeys(("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"))
    said = run(code, HOME=NOWHERE, TMPDIR=str(tmp_path), **unset)
    assert said == str(tmp_path / f"chimera_hpc-{os.getuid()}" / "matplotlib")
