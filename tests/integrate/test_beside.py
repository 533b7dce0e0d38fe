"""The stepping loops are compiled by a second process, and by this one when that fails."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from chimera_hpc.base.processes import usable_cores
from chimera_hpc.integrate import beside
from chimera_hpc.integrate.beside import stepping_loops_beside
from chimera_hpc.integrate.jit import source_digest

_WARM_UP = """
import json, sys
from numba.core import event

compiled = []
class Listener(event.Listener):
    def on_start(self, e): compiled.append(e.data["dispatcher"].py_func.__name__)
    def on_end(self, e): pass
event.register("numba:compile", Listener())
from store_tools import small_sweep
from chimera_hpc.run.block import warm_up
sweep = small_sweep()
warm_up(sweep, sweep.points())
json.dump(compiled, sys.stdout)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of kernels for a test, on a machine of two cores."""
    folder = tmp_path / source_digest()
    folder.mkdir()
    monkeypatch.setattr(beside, "cache_folder", lambda: str(folder))
    monkeypatch.setattr(beside, "usable_cores", lambda: 2)
    return folder


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """The processes that are started beside; each would go on for a minute."""
    found: list[subprocess.Popen[bytes]] = []
    start = beside._start

    def remembered() -> subprocess.Popen[bytes]:
        found.append(start())
        return found[-1]

    monkeypatch.setattr(beside, "_COMPILE", "import time; time.sleep(60)")
    monkeypatch.setattr(beside, "_start", remembered)
    return found


def test_process_beside_ends_with_an_error_here(
    folder: Path, started: list[subprocess.Popen[bytes]]
) -> None:
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), stepping_loops_beside():
        raise KeyboardInterrupt
    assert [process.returncode for process in started] == [-9]
    assert time.monotonic() - began < 30.0


def test_process_beside_that_fails_is_no_error_here(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beside, "_COMPILE", "raise SystemExit(3)")
    with stepping_loops_beside():
        pass


@pytest.mark.parametrize("reason", ["compiled", "one core", "folder of this process"])
def test_no_process_beside_where_it_is_of_no_use(
    reason: str,
    folder: Path,
    started: list[subprocess.Popen[bytes]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if reason == "compiled":
        (folder / "integrate_0").mkdir()
        (folder / "integrate_0" / "stepper._advance_vector-1.py311.1.nbc").touch()
    elif reason == "one core":
        monkeypatch.setattr(beside, "usable_cores", lambda: 1)
    else:
        monkeypatch.setattr(beside, "cache_folder", lambda: str(folder.parent))
    with stepping_loops_beside():
        assert started == []


@pytest.mark.slow
@pytest.mark.skipif(usable_cores() < 2, reason="needs two cores")
def test_first_warm_up_compiles_no_stepping_loop_itself(tmp_path: Path) -> None:
    paths = os.pathsep.join(filter(None, sys.path))
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": paths}
    command = [sys.executable, "-c", _WARM_UP]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    compiled = json.loads(done.stdout)
    assert "reduced_rhs" in compiled
    assert [name for name in compiled if "advance" in name] == []
    for name in ("_advance_one", "_advance_vector"):
        assert any(tmp_path.glob(f"*/*/kernel.{name}-*.nbc"))
