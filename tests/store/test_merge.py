"""Merging stores that keep the series of the first seed only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from store_tools import fill, make_store, results

from chimera_hpc.base.errors import BadInput
from chimera_hpc.store.merge import merge
from chimera_hpc.store.store import Store

FIRST = "keep.series=first-seed"


def merged(folder: Path, *parts: tuple[str, ...]) -> Store:
    stores = [
        fill(make_store(folder / str(number), FIRST, *overrides))
        for number, overrides in enumerate(parts)
    ]
    merge(folder / "all.zarr", stores)
    return Store.open(folder / "all.zarr")


def kept(store: Store) -> list[tuple[int, int]]:
    """Return P and seed of the points whose series can be read; each is the right one."""
    found = []
    for point in range(store.n_points):
        row = store.points.row(point)
        if row["seed"] != store.sweep.seeds[0]:
            with pytest.raises(BadInput, match="is not kept"):
                store.series(point)
            continue
        wanted = results(store, [point]).series
        assert wanted is not None
        np.testing.assert_allclose(store.series(point), 1e-4 * wanted[0], rtol=0, atol=1e-12)
        found.append((row["P"], row["seed"]))
    return sorted(found)


@pytest.mark.parametrize("seeds", [("seeds=[3,4]", "seeds=[0,3]"), ("seeds=[0,3]", "seeds=[3,4]")])
def test_series_are_those_of_the_lowest_first_seed(tmp_path: Path, seeds: tuple[str, str]) -> None:
    store = merged(tmp_path, *((seed,) for seed in seeds))
    assert kept(store) == [(2, 0), (3, 0), (4, 0)]


def test_stores_with_one_first_seed_keep_all_its_series(tmp_path: Path) -> None:
    store = merged(tmp_path, ("grid.P=3:4", "seeds=2"), ("grid.P=2:3", "seeds=3"))
    assert kept(store) == [(2, 0), (3, 0), (4, 0)]
