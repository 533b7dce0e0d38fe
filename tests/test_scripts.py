"""scripts/run and scripts/test in a copy of the tree whose lock file holds only the build tools."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BUILD_TOOLS = "editables|hatchling|packaging|pathspec|pluggy|tomlkit|trove-classifiers"
SWEEP = "import os, sys\nprint(sys.argv[1:], os.getcwd())\n"


def make_tree(tree: Path) -> Path:
    """Make a source tree that installs in seconds; its sweep prints arguments and folder."""
    shutil.copytree(ROOT / "scripts", tree / "scripts")
    for name in ("pyproject.toml", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    entries = re.findall(rf"^(?:{BUILD_TOOLS})==.*\n(?: .*\n)*", lock, flags=re.MULTILINE)
    (tree / "requirements.lock").write_text("".join(entries), encoding="utf-8")
    (tree / "README.md").touch()
    for name, text in {"__init__.py": '__version__ = "0"\n', "sweep.py": SWEEP}.items():
        (tree / "chimera_hpc").mkdir(exist_ok=True)
        (tree / "chimera_hpc" / name).write_text(text, encoding="utf-8")
    (tree / "jobs").mkdir()
    (tree / "jobs" / "quickstart.toml").touch()
    return tree


def start(tree: Path, *arguments: str, cwd: Path = ROOT, **environment: str) -> subprocess.Popen:
    return subprocess.Popen(
        [tree / "scripts" / "run", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
        env=os.environ | {"PYTHON": sys.executable} | environment,
        start_new_session=True,
    )


def run(tree: Path, *arguments: str, **options) -> str:
    """Standard output of scripts/run, which must succeed."""
    process = start(tree, *arguments, **options)
    output, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    return output


@pytest.fixture(scope="module")
def tree(tmp_path_factory) -> Path:
    """A tree in a folder with spaces, set up by its first call."""
    tree = make_tree(tmp_path_factory.mktemp("a tree [x]") / "chimera hpc")
    run(tree)
    return tree


def one_line_error(tree: Path, **environment: str) -> str:
    process = start(tree, **environment)
    output, errors = process.communicate(timeout=30)
    assert (process.returncode, output, errors.count("\n")) == (2, "", 1), errors
    assert not (tree / ".venv").exists()
    return errors


def test_unsuitable_python_is_one_line(tmp_path):
    errors = one_line_error(make_tree(tmp_path / "tree"), PYTHON="/bin/false")
    assert errors.startswith("PYTHON=/bin/false: no Python 3.11 to 3.14 was found")


def few_commands(folder):
    """Return a search path without any Python."""
    commands = folder / "bin"
    commands.mkdir()
    for name in ("bash", "dirname"):
        (commands / name).symlink_to(shutil.which(name))
    return str(commands)


def test_python_without_its_venv_module_is_one_line(tmp_path):
    python = tmp_path / "python3.14"
    python.write_text('#!/bin/sh\n[ "$1" = -V ] && echo Python 3.14.1\n')
    python.chmod(0o755)
    tree, commands = make_tree(tmp_path / "tree"), few_commands(tmp_path)
    errors = one_line_error(tree, PYTHON=str(python), PATH=commands)
    assert errors.startswith(f"{python} has no module venv or ensurepip")
    assert errors.endswith("apt install python3-venv\n")


def test_no_python_is_one_line(tmp_path):
    tree = make_tree(tmp_path / "tree")
    errors = one_line_error(tree, PYTHON="", PATH=few_commands(tmp_path))
    assert errors.startswith("no Python 3.11 to 3.14")


@pytest.mark.slow
def test_without_a_job_the_quickstart_runs(tree, tmp_path):
    job = tree / "jobs" / "quickstart.toml"
    assert run(tree, cwd=tmp_path) == f"{['run', str(job)]} {tmp_path}\n"
    assert run(tree, "--workers", "2") == f"{['run', str(job), '--workers', '2']} {ROOT}\n"


@pytest.mark.slow
def test_a_job_and_its_options_pass_through_from_any_folder(tree, tmp_path):
    arguments = ["my job.toml", "--set", "Q=[4, 5]"]
    assert run(tree, *arguments, cwd=tmp_path) == f"{['run', *arguments]} {tmp_path}\n"


@pytest.mark.slow
def test_second_call_installs_nothing(tree):
    stamp = tree / ".venv" / ".chimera-stamp"
    before = stamp.stat().st_mtime_ns
    began = time.monotonic()
    run(tree)
    assert time.monotonic() - began < 5
    assert stamp.stat().st_mtime_ns == before


@pytest.mark.slow
def test_changed_lock_file_is_installed_in_place(tree):
    kept = tree / ".venv" / "kept"
    kept.touch()
    stamp = tree / ".venv" / ".chimera-stamp"
    before = stamp.read_text()
    with (tree / "requirements.lock").open("a") as lock:
        lock.write("# changed\n")
    run(tree)
    assert kept.exists()
    assert stamp.read_text() != before


@pytest.mark.slow
def test_unfinished_installation_starts_over(tree):
    (installed,) = tree.glob(".venv/lib/python3*/site-packages/pathspec/__init__.py")
    installed.unlink()
    (tree / ".venv" / ".chimera-stamp").write_text("unfinished\n")
    run(tree)
    assert installed.exists()


@pytest.mark.slow
def test_moved_tree_starts_over(tree, tmp_path):
    moved = tmp_path / "moved"
    shutil.copytree(tree, moved, symlinks=True)
    run(moved)
    first_line = (moved / ".venv" / "bin" / "pip").read_bytes().partition(b"\n")[0]
    assert str(moved).encode() in first_line
    assert not (moved / ".venv.old").exists()


@pytest.mark.slow
def test_environment_made_by_hand_is_upgraded_in_place(tmp_path):
    tree = make_tree(tmp_path / "tree")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tree / ".venv"], check=True)
    (tree / ".venv" / "kept").touch()
    run(tree)
    assert (tree / ".venv" / "kept").exists()


@pytest.mark.slow
@pytest.mark.faults
@pytest.mark.parametrize("seconds", [1.0, 4.0])
def test_killed_installation_is_repaired(tmp_path, seconds):
    tree = make_tree(tmp_path / "tree")
    victim = start(tree)
    time.sleep(seconds)
    os.killpg(victim.pid, signal.SIGKILL)
    victim.communicate()
    run(tree)
    run(tree)


@pytest.mark.slow
@pytest.mark.faults
def test_orphans_of_a_killed_call_are_waited_for(tmp_path):
    tree = make_tree(tmp_path / "tree")
    victim = start(tree)
    while not (tree / ".venv" / "setup.log").exists():
        time.sleep(0.05)
    victim.kill()
    process = start(tree)
    _, errors = process.communicate(timeout=240)
    victim.communicate()
    assert process.returncode == 0
    assert errors.startswith(
        "another call is setting up the environment; waiting for it\nsetting up "
    )


@pytest.mark.slow
@pytest.mark.faults
def test_two_first_calls_install_once(tmp_path):
    tree = make_tree(tmp_path / "tree")
    processes = [start(tree), start(tree)]
    errors = [process.communicate(timeout=240)[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert "".join(errors).count("setting up /") == 1


@pytest.mark.slow
def test_failed_installation_says_where_its_log_is(tmp_path):
    tree = make_tree(tmp_path / "tree")
    lock = tree / "requirements.lock"
    lock.write_text(re.sub("sha256:.", "sha256:0", lock.read_text()))
    process = start(tree)
    output, errors = process.communicate(timeout=240)
    assert (process.returncode, output) == (69, "")
    assert errors.endswith(f"all of it is in {tree / '.venv' / 'setup.log'}\n")
