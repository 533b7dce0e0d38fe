"""Space-time plots, indicators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import StepPatch

from chimera_hpc.plot.indicators import IndicatorProfiles, fourier_indicators
from chimera_hpc.plot.spacetime import last_part, space_time

Render = Callable[[Figure], Figure]
T = np.linspace(0.0, 10.0, 101)
U = np.cos(T[:, None] + np.arange(8))


def test_space_time_shows_nodes_upwards_and_time_to_the_right(rendered: Render) -> None:
    u = np.zeros((101, 8))
    u[50:, 2] = 2.0  # node 3, from t = 5 on
    figure = rendered(space_time([(T, u), (T, U)], ["one", "two"]))
    axes = figure.axes[0]
    (image,) = axes.images
    left, right, bottom, top = image.get_extent()
    assert (left, right) == pytest.approx((-0.05, 10.05))
    assert (bottom, top) == (0.5, 8.5)
    assert image.origin == "lower"
    assert np.argwhere(image.get_array() == 2.0).min(axis=0).tolist() == [2, 50]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time $t$", "node $i$")
    assert [frame.get_title(loc="left") for frame in figure.axes[:2]] == ["(a)  one", "(b)  two"]


def test_space_time_panels_share_a_symmetric_colour_scale() -> None:
    figure = space_time([(T, U), (T, 3.0 * U), (T, -U)])
    limits = {frame.images[0].get_clim() for frame in figure.axes[:3]}
    (low, high) = limits.pop()
    assert not limits
    assert high == -low == pytest.approx(3.0 * np.abs(U).max())
    assert figure.axes[-1].get_ylabel() == "$u_i(t)$"


def test_space_time_zoom_adds_the_end_of_each_panel(rendered: Render) -> None:
    figure = rendered(space_time([(T, U), (T, U), (T, U)], zoom=2.0))
    pictures = [frame for frame in figure.axes if frame.images]
    assert len(pictures) == 6
    assert [len(frame.images[0].get_array().T) for frame in pictures] == [101] * 3 + [21] * 3


def test_space_time_grid_of_four_and_empty_places(rendered: Render) -> None:
    figure = rendered(space_time([(T, U)] * 3, columns=2, zoom=1.0))
    frames = figure.axes[:-1]
    assert len(frames) == 8
    assert sum(bool(frame.images) for frame in frames) == 6
    assert [frame.axison for frame in frames if not frame.images] == [False, False]


def test_last_part_keeps_both_ends() -> None:
    t, u = last_part([0.0, 1.0, 2.0, 3.0], np.arange(8).reshape(4, 2), 1.0)
    assert t.tolist() == [2.0, 3.0]
    assert u.tolist() == [[4.0, 5.0], [6.0, 7.0]]


def profiles(std: float = 0.1) -> IndicatorProfiles:
    flat = np.full(8, std)
    phase = np.linspace(-3.0, 3.0, 8)
    return IndicatorProfiles(phase, np.arange(8.0), np.full(8, 4.0), flat, 2 * flat, flat)


def test_indicators_have_a_column_a_run_and_three_rows(rendered: Render) -> None:
    figure = rendered(fourier_indicators([profiles(), profiles()], ["one", "two"]))
    assert len(figure.axes) == 6
    assert [frame.get_ylabel() for frame in figure.axes] == [
        r"$\langle\theta_i\rangle$ (rad)",
        "",
        r"$\langle a_i\rangle$",
        "",
        r"$\langle\Omega_i\rangle$ (1/time)",
        "",
    ]
    assert figure.axes[1].get_title(loc="left") == "(b)  two"
    assert figure.axes[5].get_xlabel() == "node $i$"


def test_indicators_draw_means_as_dots_and_deviations_as_bands() -> None:
    amplitude = fourier_indicators([profiles()]).axes[1]
    (dots,) = amplitude.lines
    np.testing.assert_array_equal(dots.get_xdata(), np.arange(1, 9))
    np.testing.assert_array_equal(dots.get_ydata(), np.arange(8.0))
    (band,) = amplitude.patches
    assert isinstance(band, StepPatch)
    values, edges, baseline = band.get_data()
    np.testing.assert_allclose(values, np.arange(8.0) + 0.2)
    np.testing.assert_allclose(baseline, np.arange(8.0) - 0.2)
    np.testing.assert_allclose(edges, np.arange(9) + 0.5)


def test_band_of_phases_is_repeated_a_turn_away() -> None:
    phase = fourier_indicators([profiles()]).axes[0]
    tops = sorted(float(patch.get_data().values[0]) for patch in phase.patches)
    np.testing.assert_allclose(np.diff(tops), [2.0 * np.pi] * 2)
    assert phase.get_ylim() == pytest.approx((-np.pi - 0.3, np.pi + 0.3))


def test_constant_profile_does_not_look_like_structure() -> None:
    run = profiles(0.0)
    rounding = 1e-12 * np.arange(8)
    run = replace(run, frequency=run.frequency + rounding)
    low, high = fourier_indicators([run]).axes[2].get_ylim()
    assert low < 3.9
    assert high > 4.1


def test_single_window_has_no_band_and_no_failure(rendered: Render) -> None:
    figure = rendered(fourier_indicators([profiles(np.nan)]))
    assert len(figure.axes[1].lines) == 1
