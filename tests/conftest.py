"""Options, markers and fixtures that every test file may use."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import settings

# Set before numpy is imported: one thread a process, as in the workers, and no display.
for _name in ("OMP", "MKL", "OPENBLAS", "NUMBA"):
    os.environ[f"{_name}_NUM_THREADS"] = "1"
os.environ["MPLBACKEND"] = "Agg"

# A shell's background, as in `nohup scripts/test &`, has SIGINT ignored, and every process that a
# test starts would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _no_flush(descriptor: object) -> None:
    """Nothing waits for the disk: only a loss of power could show the difference.

    Tests of what is flushed, and when, put a function of their own in its place.
    """


os.fsync = _no_flush

# A shared machine makes deadlines lie; in CI the same examples are tried every time.
settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

FOLDER = Path(__file__).parent
SLURM_PROGRAMS = ("slurmctld", "slurmd", "sbatch", "munged")
BROWSER_PROGRAMS = ("chromium", "chromedriver")
_NEEDS = {"slurm": ("SLURM", SLURM_PROGRAMS), "chromium": ("CHROMIUM", BROWSER_PROGRAMS)}


@pytest.fixture
def table() -> type:
    """A stand-in for the points of a sweep (see `cells_table.Table`)."""
    from cells_table import Table

    return Table


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--run-slow", action="store_true", help="run the tests marked slow too")


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    # --doctest-modules would import the harnesses' programs, and some replace parts of ours.
    is_program = collection_path.suffix == ".py" and not collection_path.name.startswith("test_")
    return True if is_program and FOLDER in collection_path.parents else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--run-slow"):
        _skip(items, "slow", "slow: runs with --run-slow")
    for marker, (name, programs) in _NEEDS.items():
        missing = _missing(programs)
        if missing and os.environ.get(f"REQUIRE_{name}") != "1":
            _skip(items, marker, f"no {name} on this machine: {', '.join(missing)} not found")


def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker, (name, programs) in _NEEDS.items():
        if item.get_closest_marker(marker) and (missing := _missing(programs)):
            pytest.fail(f"REQUIRE_{name}=1, but {', '.join(missing)} not found", pytrace=False)


def _skip(items: list[pytest.Item], marker: str, reason: str) -> None:
    for item in items:
        if item.get_closest_marker(marker):
            item.add_marker(pytest.mark.skip(reason=reason))


def _missing(programs: Sequence[str]) -> list[str]:
    path = os.pathsep.join((os.environ.get("PATH", os.defpath), "/usr/sbin"))
    return [name for name in programs if shutil.which(name, path=path) is None]
