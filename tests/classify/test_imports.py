from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import importlib, pkgutil, sys
import chimera_hpc.classify
for module in pkgutil.iter_modules(chimera_hpc.classify.__path__):
    importlib.import_module(f"chimera_hpc.classify.{module.name}")
print(*(n for n in ("zarr", "dask", "sklearn", "matplotlib", "numba") if n in sys.modules))
"""


def test_reduction_imports_neither_storage_nor_slow_libraries() -> None:
    run = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
