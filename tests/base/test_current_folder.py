"""What stays on the Python path of the command line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from chimera_hpc.base import current_folder

PACKAGE = Path(current_folder.__file__).parents[2]
CODE = """\
import json, sys
before = list(sys.path)
from chimera_hpc.base.current_folder import leave_current_folder
leave_current_folder()
print(json.dumps([before, sys.path]))
"""


def paths(folder: Path, *options: str, python_path: Path = PACKAGE) -> tuple[list[str], list[str]]:
    """Return the path before and after, in a new process."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(python_path), str(PACKAGE)])}
    environment.pop("PYTHONSAFEPATH", None)
    done = subprocess.run(
        [sys.executable, *options], env=environment, cwd=folder, capture_output=True, check=True
    )
    before, after = json.loads(done.stdout)
    return before, after


def test_the_current_folder_goes_and_the_rest_stays(tmp_path: Path) -> None:
    before, after = paths(tmp_path, "-c", CODE)
    assert before[0] == ""
    assert after == before[1:]


def test_the_folder_of_a_script_stays(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    script = tmp_path / "elsewhere" / "script.py"
    script.write_text(CODE)
    before, after = paths(tmp_path, str(script))
    assert before[0] == str(script.parent)
    assert after == before


@pytest.mark.parametrize("safe", [True, False])
def test_a_current_folder_that_the_user_put_on_the_path_stays(safe: bool, tmp_path: Path) -> None:
    options = ["-P"] if safe else []
    before, after = paths(tmp_path, *options, "-c", CODE, python_path=tmp_path)
    assert str(tmp_path) in before
    assert str(tmp_path) in after
