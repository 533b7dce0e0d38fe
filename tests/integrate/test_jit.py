"""How kernels are compiled: strict arithmetic, no allocation, a cache that hits and never lies."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest

import chimera_hpc
from chimera_hpc.integrate import jit as _jit
from chimera_hpc.integrate.jit import cache_folder, jit, source_digest
from chimera_hpc.network.topology import Topology
from chimera_hpc.run.simulate import simulate

PACKAGE = Path(chimera_hpc.__file__).parent


def python(code, *, package=PACKAGE, **environment):
    """Run code in a new process that imports this package; returns its standard output."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=package.parent,  # "-c" looks there first
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


RUN = """
import numpy as np
from chimera_hpc import Topology, simulate
topology = Topology.ring(8, 3).reorient_node(0, 2)
run = simulate(topology, u0=np.linspace(-1, 1, 8), v0=np.zeros(24), t_end=0.5, t_step=0.1)
print(run.u.tobytes().hex())
"""


def run_here():
    topology = Topology.ring(8, 3).reorient_node(0, 2)
    u0 = np.linspace(-1, 1, 8)
    return simulate(topology, u0=u0, v0=np.zeros(24), t_end=0.5, t_step=0.1).u.tobytes().hex()


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """A cache folder for the kernels of a test."""
    monkeypatch.setattr(_jit, "cache_folder", lambda: str(tmp_path))
    return tmp_path


# --- the cache ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_second_process_compiles_nothing():
    expected = run_here()
    output = python(RUN, NUMBA_DEBUG_CACHE="1").splitlines()
    assert output[-1] == expected
    saved = [line for line in output if "data saved" in line]
    loaded = [line for line in output if "data loaded" in line]
    assert saved == []
    assert any("stepper._advance_one" in line for line in loaded)
    assert any("topological_fhn_kernels.reduced_rhs" in line for line in loaded)
    assert all(f"/{source_digest()}/" in line for line in loaded)


@pytest.fixture
def copied_package(tmp_path, monkeypatch):
    """A copy of the package's sources, which `source_digest` looks at."""
    copy = tmp_path / "chimera_hpc"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(_jit, "_PACKAGE", copy)
    return copy


def digest_now():
    return source_digest.__wrapped__()


@pytest.mark.parametrize(
    "file",
    [
        "integrate/stepper.py",
        "integrate/simd.py",
        "integrate/jit.py",
        "models/topological_fhn_kernels.py",
        "models/networked_fhn_kernels.py",
        "measures/lines.py",
        "measures/series.py",
    ],
)
def test_an_edit_of_a_kernel_changes_the_cache_folder(copied_package, file):
    assert digest_now() == source_digest()
    with (copied_package / file).open("a") as source:
        source.write("\n")
    assert digest_now() != source_digest()


def test_a_new_file_of_kernels_changes_the_cache_folder(copied_package):
    (copied_package / "models" / "another.py").write_text("")
    assert digest_now() != source_digest()


def test_an_edit_elsewhere_keeps_the_compiled_kernels(copied_package):
    with (copied_package / "task.py").open("a") as source:
        source.write("\n")
    assert digest_now() == source_digest()


def test_every_file_with_a_kernel_is_in_the_digest():
    for file in PACKAGE.rglob("*.py"):
        uses = re.search(r"\.jit import [^\n]*\bjit\b", file.read_text())
        assert not uses or file.parent.name in _jit._KERNEL_FOLDERS, file


def test_another_numba_changes_the_cache_folder(monkeypatch):
    monkeypatch.setattr(_jit, "version", lambda name: "0.0.1")
    assert digest_now() != source_digest()


CALLED = """
from chimera_hpc.integrate.jit import jit

@jit()
def called(x):
    return x + 1.0
"""
CALLING = """
from chimera_hpc.measures.called import called
from chimera_hpc.integrate.jit import jit

@jit()
def calling(x):
    return 2.0 * called(x)
"""


@pytest.mark.slow
def test_an_edit_of_a_called_kernel_is_obeyed_by_the_next_process(tmp_path):
    # numba alone serves the old code here: it looks at the file of the outermost function only.
    copy, cache = tmp_path / "chimera_hpc", tmp_path / "cache"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "measures" / "called.py").write_text(CALLED)
    (copy / "measures" / "calling.py").write_text(CALLING)

    def run():
        code = "from chimera_hpc.measures.calling import calling; print(calling(3.0))"
        return python(code, package=copy, NUMBA_CACHE_DIR=str(cache), NUMBA_DEBUG_CACHE="1")

    assert "data saved" in run()
    again = run()
    assert again.endswith("\n8.0\n")
    assert "data saved" not in again
    (copy / "measures" / "called.py").write_text(CALLED.replace("1.0", "5.0"))
    assert run().endswith("\n16.0\n")
    assert len(list(cache.iterdir())) == 2


def test_cache_folder_follows_the_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "node"))
    assert cache_folder.__wrapped__() == str(tmp_path / "node" / source_digest())
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    expected = tmp_path / "user" / "chimera_hpc" / "numba" / source_digest()
    assert cache_folder.__wrapped__() == str(expected)
    assert expected.is_dir()


def test_cache_folders_of_other_sources_go_when_unused_for_long(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    ours, old, broken_off = source_digest(), "0" * 16, f"{'1' * 16}.{'a' * 32}.old"
    kept = [ours, "2" * 16, "somebody_elses", "3" * 15]
    for name in [*kept, old, broken_off]:
        (tmp_path / name / "kernel").mkdir(parents=True)
        (tmp_path / name / "kernel" / "code.nbc").write_text("")
        long_ago = time.time() - (29 if name == "2" * 16 else 31) * 86400
        os.utime(tmp_path / name, (long_ago, long_ago))
    before = time.time()
    assert cache_folder.__wrapped__() == str(tmp_path / ours)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(kept)
    assert (tmp_path / ours / "kernel" / "code.nbc").exists()
    # Its use is seen by later processes.
    assert (tmp_path / ours).stat().st_mtime > before - 2


def test_cache_folder_that_cannot_be_made_is_replaced(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    folder = Path(cache_folder.__wrapped__())
    assert folder.parents[1] == tmp_path / f"chimera_hpc-{os.getuid()}"
    assert folder.is_dir()


def test_folder_of_other_users_of_numba_is_left_as_it_was(own_cache):
    before = numba.config.CACHE_DIR
    assert jit()(lambda x: x)(3) == 3
    assert before == numba.config.CACHE_DIR
    assert list(own_cache.rglob("*.nbc"))


# --- the arithmetic -------------------------------------------------------------------------------


@pytest.mark.usefixtures("own_cache")
def test_a_kernel_that_allocates_does_not_compile():
    def allocates(n):
        return np.zeros(n)[0]

    assert numba.njit(allocates)(3) == 0.0
    with pytest.raises(numba.core.errors.TypingError, match="zeros"):
        jit()(allocates)(3)


@pytest.mark.slow
def test_kernels_are_compiled_in_one_place_and_without_fast_math():
    for file in PACKAGE.rglob("*.py"):
        tree = ast.parse(file.read_text())
        names = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        options = {node.arg for node in ast.walk(tree) if isinstance(node, ast.keyword)}
        assert not options & {"fastmath", "parallel"}, file
        if file.name != "jit.py":
            assert not names & {"njit", "jit", "vectorize", "guvectorize"}, file


@pytest.mark.usefixtures("own_cache")
def test_options_of_a_kernel():
    kernel = jit()(lambda x: x)
    assert kernel.targetoptions["nogil"] is True
    assert kernel.targetoptions["error_model"] == "numpy"
    assert "fastmath" not in kernel.targetoptions


@pytest.mark.usefixtures("own_cache")
def test_a_sum_keeps_its_order_and_products_are_rounded():
    # 1 + 2**-53 is 1 and the rounded square of 1 + 2**-30 has lost its last bit: neither
    # reassociation nor a fused multiply-add may repair them.
    x, tiny = 1.0 + 2.0**-30, 2.0**-53

    @jit()
    def compute(x, tiny, values):
        total = 1.0
        for i in range(values.size):
            total = total + values[i]
        return total, x * x - (1.0 + 2.0**-29)

    total, left = compute(x, tiny, np.full(64, tiny))
    assert total == 1.0
    assert left == 0.0


# --- without compilation --------------------------------------------------------------------------


@pytest.mark.slow
def test_kernels_do_the_same_without_compilation():
    assert python(RUN, NUMBA_DISABLE_JIT="1") == run_here() + "\n"


RUN_VECTOR = """
import numpy as np
from chimera_hpc.integrate.lanes import Control, integrate
from chimera_hpc.models.networked_fhn import NetworkedFHN

def run():
    model, found = NetworkedFHN(11, 3), {}
    states = [np.linspace(-1, 1, 22) * (1 + number) for number in range(3)]
    integrate(
        [model] * 3, states, Control(0.5, 0.0, 0.1, rtol=1e-4), 11,
        lambda number, end: found.update({number: end.samples.tobytes().hex()}), lanes=8,
    )
    return " ".join(found[number] for number in range(3))
"""


@pytest.mark.slow
def test_vectors_do_the_same_without_compilation():
    here = {}
    exec(RUN_VECTOR, here)
    assert python(RUN_VECTOR + "print(run())", NUMBA_DISABLE_JIT="1") == here["run"]() + "\n"


@pytest.mark.slow
def test_a_processor_without_fused_instructions_gives_the_same_bits(tmp_path):
    # Compiled for the oldest processor of this kind: the C library multiplies and adds there.
    here = {}
    exec(RUN_VECTOR, here)
    old = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    assert python(RUN_VECTOR + "print(run())", **old) == here["run"]() + "\n"
