"""Names and encodings of what a store holds."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from store_tools import encode_series, small_sweep

from chimera_hpc.job import Sweep
from chimera_hpc.store.schema import (
    FEATURES,
    array_plans,
    decode_series,
    room,
    sample_times,
    scalar_labels,
    series_mask,
)


def test_labels_are_those_of_the_contract() -> None:
    from chimera_hpc.measures import fourier

    assert fourier.FEATURES == FEATURES
    job = {"name": "x", "model": "topological_fhn", "grid": {"P": 3, "Q": 0}}
    assert scalar_labels(Sweep.from_dict({**job, "features": {"groups": 2}})) == (
        *("V_theta", "V_a", "V_Omega", "sigma_1", "sigma_2"),
        *("std_u", "range_u", "order_parameter", "distance"),
        *("local_sigma_1", "local_sigma_2"),
    )


@given(st.lists(st.floats(-5, 5) | st.just(np.nan) | st.just(np.inf), min_size=1))
def test_int16_keeps_four_decimals_or_says_missing(values: list[float]) -> None:
    u = np.array(values)
    stored = encode_series(u, "int16")
    assert stored.dtype == np.int16
    back = decode_series(stored)
    fits = np.abs(u) < 3.27674
    np.testing.assert_allclose(back[fits], u[fits], atol=0.50001e-4)
    assert np.isnan(back[~(np.abs(u) <= 3.27676)]).all()


@given(st.lists(st.floats(width=32, allow_nan=True), min_size=1))
def test_float32_keeps_what_it_can(values: list[float]) -> None:
    u = np.array(values)
    np.testing.assert_array_equal(decode_series(encode_series(u, "float32")), u)


def test_samples_run_from_the_start_of_the_analysis_to_the_end() -> None:
    times = sample_times(small_sweep())
    assert (times[0], times[-1], len(times)) == (10.0, 20.0, 21)
    fine = sample_times(small_sweep("integrator.t_step=0.01", "integrator.t_end=20.004"))
    assert len(fine) == 1001
    np.testing.assert_allclose(fine, np.linspace(10, 20, 1001), rtol=1e-14)


@pytest.mark.parametrize(("keep", "kept"), [("all", [0, 1, 2]), ("first-seed", [0]), ("none", [])])
def test_series_mask_tells_whose_series_is_kept(keep: str, kept: list[int]) -> None:
    sweep = small_sweep(f"keep.series={keep}", "seeds=[7, 3, 9]")
    mask = series_mask(sweep, np.array([7, 3, 9]))
    assert np.flatnonzero(mask).tolist() == kept


def test_room_counts_only_the_series_that_are_kept() -> None:
    rooms = {}
    for keep in ("all", "first-seed", "none"):
        sweep = small_sweep(f"keep.series={keep}")
        rooms[keep] = room(sweep, sweep.points().columns, 4).bytes
    series = 21 * 12 * 2
    few = rooms["first-seed"] - rooms["none"]
    assert rooms["all"] - rooms["first-seed"] == 12 * series
    assert 3 * series <= few <= 3 * series + 3 * 4096


def test_every_array_has_units_and_a_long_name() -> None:
    sweep = small_sweep()
    for plan in array_plans(sweep, sweep.points().columns, 4):
        assert plan.attributes["units"]
        assert plan.attributes["long_name"]


def test_layout_imports_neither_zarr_nor_kernels() -> None:
    code = (
        "import sys, chimera_hpc.store.schema;"
        "heavy = {'zarr', 'numba', 'sklearn', 'dask', 'xarray'} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
