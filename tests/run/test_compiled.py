"""Kernels that are known to be compiled are not loaded to find out."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from store_tools import small_sweep

from chimera_hpc.job import Sweep
from chimera_hpc.run import block as task
from chimera_hpc.run import compiled
from chimera_hpc.run.compiled import compile_once


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of kernels for a test."""
    monkeypatch.setattr(compiled, "cache_folder", lambda: str(tmp_path))
    return tmp_path


@pytest.fixture
def made(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The sweeps for which something was compiled: one file each."""
    found: list[str] = []

    def compile_(sweep: Sweep, points: object) -> None:
        found.append(sweep.name)
        (folder / "there").mkdir(exist_ok=True)
        (folder / "there" / f"kernel-{len(found)}.nbc").write_bytes(b"")

    monkeypatch.setattr(task, "warm_up", compile_)
    # No second process.
    monkeypatch.setattr(compiled, "usable_cores", lambda: 1)
    return found


def ask(sweep: Sweep, load: bool = False) -> None:
    compile_once(sweep, sweep.points(), load=load)


def changed(**changes: object) -> Sweep:
    return Sweep.from_dict(small_sweep().to_dict() | changes)


def test_compiled_once_for_all_sweeps_of_a_kind(made: list[str]) -> None:
    sweep = small_sweep()
    for _ in range(2):
        ask(sweep)
        ask(changed(name="other", grid=sweep.to_dict()["grid"] | {"seeds": 2}))
    assert made == [sweep.name]


def test_process_that_needs_them_itself_loads_them(made: list[str]) -> None:
    for _ in range(2):
        ask(small_sweep(), load=True)
    assert len(made) == 2


def test_another_method_another_processor_and_a_lost_kernel_are_seen(
    made: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask(small_sweep())
    method = changed(integrator=small_sweep().to_dict()["integrator"] | {"method": "dopri5"})
    ask(method)
    ask(method)
    assert len(made) == 2
    monkeypatch.setattr(compiled, "cpu_model", lambda: "another one")
    ask(method)
    assert len(made) == 3
    (folder / "there" / "kernel-1.nbc").unlink()
    ask(method)
    assert len(made) == 4


@pytest.mark.parametrize("contents", [b"", b"null", b"{", b"[[]]"])
def test_damaged_mark_is_no_mark(contents: bytes, made: list[str], folder: Path) -> None:
    ask(small_sweep())
    (mark,) = folder.glob("compiled-*")
    mark.write_bytes(contents)
    ask(small_sweep())
    assert len(made) == 2


def test_driver_of_workers_loads_no_numba() -> None:
    modules = ("run.driver", "run.compiled", "run.executors", "run.local_cluster")
    modules += ("store", "reduction.reduction")
    code = "import sys\n" + "".join(f"import chimera_hpc.{name}\n" for name in modules)
    code += "assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
