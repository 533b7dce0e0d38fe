"""Space-time plots, indicators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import StepPatch

from chimera_hpc.plot.indicators import IndicatorProfiles, fourier_indicators
from chimera_hpc.plot.spacetime import draw_panels, panel_rasters, space_time

Render = Callable[[Figure], Figure]
T = np.linspace(0.0, 10.0, 101)
U = np.cos(T + np.arange(8)[:, None])
FAST = np.cos(80.0 * np.linspace(0.0, 10.0, 2001) + np.arange(8)[:, None])


def test_space_time_shows_nodes_upwards_and_time_to_the_right(rendered: Render) -> None:
    u = np.zeros((8, 101))
    u[2, 50:] = 2.0  # node 2, from t = 5 on
    figure = rendered(space_time([(T, u), (T, U)], ["one", "two"]))
    axes = figure.axes[0]
    (image,) = axes.images
    left, right, bottom, top = image.get_extent()
    assert (left, right) == pytest.approx((-0.05, 10.05))
    assert (bottom, top) == (-0.5, 7.5)
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


def test_periods_that_cannot_be_told_apart_are_drawn_by_their_range(rendered: Render) -> None:
    figure = rendered(space_time([(np.linspace(0.0, 10.0, 2001), FAST)] * 3))
    pictures = [frame for frame in figure.axes if frame.images]
    upper, lower = pictures[:3], pictures[3:]
    for frame in upper:  # not the mean of a period, which looks like a fixed point
        np.testing.assert_allclose(frame.images[0].get_array(), 2.0, atol=0.1)
        assert frame.images[0].get_clim()[0] == 0.0
    assert [frame.get_title(loc="left") for frame in lower] == ["last 12 of 128 periods"] * 3
    start, end = lower[0].images[0].get_extent()[:2]
    assert end - start == pytest.approx(12 * 2.0 * np.pi / 80.0, rel=0.05)
    labels = [frame.get_ylabel() for frame in figure.axes[-2:]]
    assert sorted(labels) == ["$u_i(t)$", "range of $u_i(t)$ in a period"]


@pytest.mark.parametrize("n_panels", [1, 3, 4])
def test_panels_made_one_by_one_are_drawn_as_those_of_whole_series(n_panels: int) -> None:
    slow = (np.linspace(0.0, 10.0, 2001), np.repeat(U, 20, axis=1)[:, :2001])
    fast = (slow[0], FAST)
    for panels in ([slow] * n_panels, [slow, fast, fast, slow][:n_panels]):
        whole = space_time(panels)
        parts = draw_panels([panel_rasters(t, u, n_panels) for t, u in panels])
        drawn = [[axes.images[0] for axes in made.axes if axes.images] for made in (whole, parts)]
        for one, other in zip(*drawn, strict=True):
            np.testing.assert_array_equal(one.get_array(), other.get_array())
            assert one.get_extent() == other.get_extent()
            assert one.get_clim() == other.get_clim()


def test_space_time_grid_of_four_and_empty_places(rendered: Render) -> None:
    figure = rendered(space_time([(T, U)] * 3, columns=2))
    frames = figure.axes[:-1]
    assert [frame.axison for frame in frames] == [True, True, True, False]


def test_names_of_nodes_stand_along_their_axis_whatever_is_in_them(rendered: Render) -> None:
    names = [f"$F_{i}$ 5$" for i in range(8)]
    figure = rendered(space_time([(T, U)], ["recording"], names=names))
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == [name.replace("$", r"\$") for name in names]
    figure = rendered(fourier_indicators([profiles()], ["recording"], names))
    assert len(figure.axes[2].get_xticklabels()) == 8


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
    np.testing.assert_array_equal(dots.get_xdata(), np.arange(8))
    np.testing.assert_array_equal(dots.get_ydata(), np.arange(8.0))
    (band,) = amplitude.patches
    assert isinstance(band, StepPatch)
    values, edges, baseline = band.get_data()
    np.testing.assert_allclose(values, np.arange(8.0) + 0.2)
    np.testing.assert_allclose(baseline, np.arange(8.0) - 0.2)
    np.testing.assert_allclose(edges, np.arange(9) - 0.5)


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


def test_profile_of_many_nodes_is_drawn_in_steps_that_reach_as_far_as_the_nodes() -> None:
    rng = np.random.default_rng(0)
    mean, deviation = rng.normal(size=(2, 20_000))
    deviation = np.abs(deviation)
    mean[12_345] = 9.0  # one node in twenty thousand
    run = IndicatorProfiles(*[mean] * 3, *[deviation] * 3)
    amplitude = fourier_indicators([run]).axes[1]
    assert not amplitude.lines
    band, means = amplitude.patches
    assert isinstance(means, StepPatch)
    assert isinstance(band, StepPatch)
    high, edges, low = means.get_data()
    assert len(high) == 400
    step = int(np.searchsorted(edges, 12_345)) - 1
    assert (high.max(), int(high.argmax())) == (9.0, step)
    assert low.min() == mean.min()
    assert band.get_data().values.max() == pytest.approx((mean + deviation).max())
