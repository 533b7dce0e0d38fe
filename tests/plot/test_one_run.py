"""Figures of one run: portrait, spectrum without a parabola, a place among an atlas's runs."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.plot.indicators import _draw_profile, profiles_of
from chimera_hpc.plot.judged import judged
from chimera_hpc.plot.portrait import ring_portrait
from chimera_hpc.plot.raster import Raster
from chimera_hpc.plot.spacetime import draw_raster
from chimera_hpc.plot.spectrum import Spectrum, spectrum

T = 0.1 * np.arange(101)
PHASE = 2.0 * np.pi * (T[:, None] / 2.0 + np.arange(6) / 6)


def test_portrait_has_the_orbit_of_the_node_and_a_dot_for_every_node():
    figure = ring_portrait(T, np.cos(PHASE), np.sin(PHASE), 2, period=2.0, nullcline=True)
    axes = figure.axes[0]
    orbit = axes.get_lines()[6].get_xydata()
    assert orbit == pytest.approx(np.column_stack([np.cos(PHASE[:, 2]), np.sin(PHASE[:, 2])]))
    # Of the others the last turn and a half: 3 units of time, 31 samples.
    assert len(axes.get_lines()[0].get_xdata()) == 31
    dots = axes.collections[0].get_offsets()
    assert np.asarray(dots) == pytest.approx(np.column_stack([np.cos(PHASE), np.sin(PHASE)])[-1, [
        [i, i + 6] for i in range(6)]])  # fmt: skip
    line = axes.get_lines()[7].get_xydata()
    assert line[:, 1] == pytest.approx(line[:, 0] - line[:, 0] ** 3 / 3.0)


@pytest.mark.parametrize(("peak", "has"), [(1, False), (2, True), (19, True), (20, False)])
def test_peak_at_the_edge_of_the_spectrum_has_no_parabola(peak: int, has: bool):
    amplitude = np.full(21, 0.1)
    amplitude[peak] = 1.0
    data = Spectrum(T, np.cos(PHASE[:, 0]), 0.1 * np.arange(21), amplitude, peak)
    assert data.has_parabola == has
    labels = [line.get_label() for line in spectrum(data).axes[1].get_lines()]
    assert ("parabola" in labels) == has


def test_star_stands_at_the_variations_of_the_recording():
    triplets = np.random.default_rng(0).uniform(size=(9, 3))
    names = ("ordered", "chimera", "disordered")
    figure = judged(triplets, np.arange(9) % 3, names, (0.1, 0.2, 0.3), "chimera")
    stars = [axes.get_lines()[0].get_xydata()[0].tolist() for axes in figure.axes]
    assert stars == [[0.1, 0.2], [0.1, 0.3], [0.2, 0.3]]
    assert figure.legends[0].get_texts()[-1].get_text() == "the recording: chimera"


def test_profiles_take_the_rows_of_their_names():
    found = profiles_of(np.arange(8.0)[:, None] * np.ones(5))
    assert [np.asarray(x)[0] for x in (found.amplitude, found.frequency, found.phase)] == [0, 1, 2]
    assert [np.asarray(x)[0] for x in (found.amplitude_std, found.phase_std)] == [4, 6]


def test_flat_profile_looks_flat_and_ranges_have_colours_of_their_own():
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    _draw_profile(axes, 100.0 + 1e-9 * np.arange(8), np.zeros(8), 0.0)
    assert axes.get_ylim() == pytest.approx((95.0, 105.0))
    values = np.ones((3, 4))
    for is_range, colours in ((False, "viridis"), (True, "magma")):
        image = draw_raster(axes, Raster(values, (0.0, 1.0), (0, 3), is_range=is_range), 2.0)
        assert image.get_cmap().name == colours
        assert image.get_clim() == (0.0 if is_range else -2.0, 2.0)
