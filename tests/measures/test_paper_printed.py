"""The preset paper-printed against its recipe, on series of the diagonal Q = P.

tests/data/paper-printed.npz holds u of five neighbours (in steps of 1e-4, t = 950 to 1000) of runs
of the reduced form at rtol 1e-3, and the triplets of the reference code, whose bounded search stops
at 1e-8 of a frequency.
"""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from pathlib import Path

import naive
import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.conventions import PRESETS
from chimera_hpc.measures.fourier import fourier_features
from chimera_hpc.measures.variation import total_variations
from chimera_hpc.measures.windows import maxima

Array = NDArray[np.float64]
RUNS = ("P3_seed0", "P3_seed1", "P7_seed0", "P9_seed0", "P12_seed0", "P21_seed0", "P24_seed0")
# Every run takes seconds without JIT.
SOME = ("P3_seed1", "P12_seed0") if numba.config.DISABLE_JIT else RUNS
T = 0.01 * np.arange(95_000, 100_001)


@pytest.fixture(scope="module")
def stored() -> dict[str, Array]:
    with np.load(Path(__file__).parents[1] / "data" / "paper-printed.npz") as file:
        return {name: file[name] * (1.0 if "triplet" in name else 1e-4) for name in file}


@pytest.mark.parametrize("run", SOME)
def test_triplets_equal_the_recipe_and_the_reference_code(
    run: str, stored: dict[str, Array]
) -> None:
    u = stored[run]
    triplet = total_variations(fourier_features(T, u, preset="paper-printed"))
    assert triplet == pytest.approx(naive.paper_printed(T, u), abs=1e-9)
    assert triplet == pytest.approx(tuple(stored[f"{run}_triplet"]), abs=1e-7)


def test_at_most_four_windows_count(stored: dict[str, Array]) -> None:
    u = stored["P24_seed0"]
    assert fourier_features(T, u, preset="paper-printed").n_windows == 4
    assert fourier_features(T, u, preset="paper-printed", max_windows=2).n_windows == 2
    assert fourier_features(T, u, preset="paper-printed", max_windows=0).n_windows > 4


def test_a_preset_is_the_same_as_its_settings(stored: dict[str, Array]) -> None:
    u = stored["P12_seed0"]
    preset = fourier_features(T, u, preset="paper-printed").as_array()
    spelt = fourier_features(T, u, **PRESETS["paper-printed"]).as_array()
    assert preset.tobytes() == spelt.tobytes()
    default = fourier_features(T, u, preset="default").as_array()
    assert default.tobytes() == fourier_features(T, u).as_array().tobytes()


def test_the_default_preset_holds_the_defaults_of_the_function_and_of_a_job() -> None:
    arguments = inspect.signature(fourier_features).parameters
    for name, value in PRESETS["default"].items():
        assert arguments[name].default == Features.model_fields[name].default == value


def test_an_unknown_preset_is_named() -> None:
    with pytest.raises(BadInput, match="preset must be one of default, paper-printed, not 'paper'"):
        fourier_features(T, np.zeros((T.size, 3)), preset="paper")


def test_signals_that_stand_still_have_their_levels() -> None:
    u = np.broadcast_to([1.0, 3.0, 2.0, 2.0], (T.size, 4))
    found = fourier_features(T, u, steady="level")
    assert found.status is Status.STEADY
    assert found.baseline.tolist() == [1.0, 3.0, 2.0, 2.0]
    assert total_variations(found) == (0.0, 1.0, 0.0)
    assert total_variations(found, ring=False) == pytest.approx((0.0, 1.0, 0.0))
    assert np.isnan(total_variations(fourier_features(T, u))).all()


@pytest.mark.filterwarnings("ignore:fourier_features. column 2 of u never changes")
def test_a_signal_with_too_few_maxima_has_its_level_too() -> None:
    slow = 1.0 + np.cos(2 * np.pi * T / 40)
    u = np.stack([np.cos(2 * np.pi * T), slow, np.full(T.size, 5.0)], axis=1)
    found = fourier_features(T, u, window_reference="own", steady="level")
    assert found.status is Status.NO_WINDOW
    expected = np.abs(np.diff(np.append(u.mean(axis=0), u.mean(axis=0)[0]))).mean()
    assert total_variations(found) == pytest.approx((0.0, expected, 0.0), abs=1e-12)


def test_phases_of_the_recording_are_those_at_its_first_sample() -> None:
    angle = 2 * np.pi * 0.7 * (T - T[0])
    u = np.stack([np.cos(angle + 1.0), np.cos(angle - 2.0), np.cos(angle + 3.0)], axis=1)
    found = fourier_features(T, u, refine="sine-fit", time_origin="recording")
    np.testing.assert_allclose(found.phase, [1.0, -2.0, 3.0], atol=1e-9)


@pytest.mark.parametrize("prominence", [0.0, 0.3, 1.0, 1.5, 4.0])
def test_prominent_maxima_are_those_of_scipy(prominence: float) -> None:
    rng = np.random.default_rng(5)
    for x in (rng.normal(size=400), rng.integers(0, 4, 400).astype(float)):
        expected = naive.find_peaks(x, prominence=prominence)[0]
        assert maxima(x, prominence).tolist() == expected.tolist()
        assert maxima(x, prominence, 7).tolist() == expected[:7].tolist()


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="this is the run without JIT")
def test_the_same_without_jit() -> None:
    some = "triplets or prominent or level"
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", some, __file__],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "passed" in run.stdout
