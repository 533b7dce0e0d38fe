"""The programs behind scripts, as modules: several of them are called ``__main__``."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

SCALE = Path(__file__).parent / "scale" / "__main__.py"


def load_program(path: Path, name: str) -> ModuleType:
    """Import the file `path` under the name `name`."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
