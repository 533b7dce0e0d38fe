"""A filled store, made once and copied for each test that spoils it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from store_tools import fill, make_store

from chimera_hpc.store.store import Store


@pytest.fixture(scope="session")
def _filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill(make_store(tmp_path_factory.mktemp("filled"))).path


@pytest.fixture
def filled(_filled: Path, tmp_path: Path) -> Store:
    """Return a store of the small sweep in which every point is done."""
    return Store.open(shutil.copytree(_filled, tmp_path / "store.zarr"))
