"""Figures of single experiments, of networks and of the Fourier method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from chimera_hpc.network.layout import circle
from chimera_hpc.plot import style
from chimera_hpc.plot.agreement import (
    Comparison,
    agreement_matrix,
    confusion_matrices,
    verdict_maps,
    verdicts,
)
from chimera_hpc.plot.atlas import Diamonds, atlas
from chimera_hpc.plot.basin import basin
from chimera_hpc.plot.boundaries import boundaries
from chimera_hpc.plot.class_number import class_number
from chimera_hpc.plot.density import Density, density_classes
from chimera_hpc.plot.incoherence import Strengths, incoherence
from chimera_hpc.plot.network import arrow_heads, networks
from chimera_hpc.plot.raster import close_up
from chimera_hpc.plot.robustness import Band, robustness
from chimera_hpc.plot.spectrum import Spectrum, spectrum, vertex
from chimera_hpc.plot.synthetic import reconstruction

Render = Callable[[Figure], Figure]


def same(colour: Any, name: str) -> bool:
    return np.allclose(to_rgb(colour), to_rgb(name))


def test_basin_shows_fraction_over_half_degree_and_radius(rendered: Render) -> None:
    fraction = np.array([[1.0, 0.5], [1.0, np.nan], [0.0, 0.25]])
    figure = rendered(basin([1, 2, 3], [0.1, 0.2], fraction, [0.2, 0.1, np.nan]))
    axes, bar = figure.axes
    (mesh,) = axes.collections
    shown = mesh.get_array()
    np.testing.assert_array_equal(shown.filled(-1.0), [[1.0, 1.0, 0.0], [0.5, -1.0, 0.25]])
    assert mesh.get_clim() == (0.0, 1.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$P$", "radius $R$")
    assert bar.get_ylabel() == "$f = N'/N$"
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [0.2, 0.1, np.nan])


def test_boundaries_over_a_plane_are_bars_along_their_axis(rendered: Render) -> None:
    cells = [
        {"class": name, "decided": True, "P": P, "Q": Q}
        for P, Q, name in ((4, 1, "ordered"), (8, 1, "chimera"), (4, 5, "chimera"))
    ]
    axes = [(f"${name}$", np.array([float(cell[name]) for cell in cells])) for name in ("P", "Q")]
    found = [
        {"axis": "P", "Q": 1, "at": 6.0, "interval": [4.0, 8.0]},
        {"axis": "Q", "P": 4, "at": 3.0, "interval": [1.0, 5.0]},
    ]
    figure = rendered(boundaries(axes, cells, found, {"P": 0, "Q": 1}))
    bars = [bar for container in figure.axes[0].containers for bar in container[2]]
    ends = [bar.get_segments()[0].tolist() for bar in bars]
    assert ends == [[[4.0, 1.0], [8.0, 1.0]], [[4.0, 1.0], [4.0, 5.0]]]


def test_robustness_draws_teal_dots_and_green_stars_with_bands(rendered: Render) -> None:
    band = Band([0, 5], [1.0, 0.2], [0.7, 0.1], [1.0, 0.5])
    curves = {"orientation 1": band, "orientation 2": band, "other reading": band}
    figure = rendered(robustness(curves))
    axes = figure.axes[0]
    one, two, _ = axes.lines
    assert (one.get_marker(), same(one.get_color(), style.GREEN)) == ("*", True)
    assert (two.get_marker(), same(two.get_color(), style.TEAL)) == ("o", True)
    assert len(axes.collections) == 3
    edge = axes.collections[0].get_paths()[0].vertices
    assert (edge[:, 1].min(), edge[:, 1].max()) == (0.1, 1.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("reoriented links $Q_r$", "$W$")


def test_atlas_draws_light_classes_and_diamonds_by_the_parameter(rendered: Render) -> None:
    triplets = np.array([[0.1, 0.0, 0.0], [0.3, 0.1, 0.2]])
    panels = [
        Diamonds("$P = 6$", [[0.1, 0.01, 0.0], [0.2, 0.02, 0.0]], [0.01, 0.1]),
        Diamonds("$P = 12$", [[0.3, 0.05, 0.0]], [0.05]),
    ]
    figure = rendered(atlas(triplets, [0, 1], ("ordered", "chimera"), panels))
    first, second, bar = figure.axes
    ordered, chimera, diamonds = first.collections
    assert same(ordered.get_facecolors()[0], style.lighten(style.RED, 0.72))
    np.testing.assert_allclose(chimera.get_offsets(), [[0.3, 0.1]])
    np.testing.assert_allclose(diamonds.get_offsets(), [[0.1, 0.01], [0.2, 0.02]])
    np.testing.assert_allclose(diamonds.get_array(), [0.01, 0.1])
    light, dark = (np.sum(to_rgb(diamonds.cmap(diamonds.norm(v)))) for v in (0.01, 0.1))
    assert light > dark + 1.0
    assert diamonds.get_clim() == second.collections[-1].get_clim() == (0.01, 0.1)
    assert bar.get_ylabel() == r"$\epsilon$"
    assert second.get_title(loc="left") == "(b)  $P = 12$"


def test_incoherence_colours_squares_by_strength(rendered: Render, colour_at: Any) -> None:
    panel = Strengths("", [2, 3, 4], [0.0, 0.4, 1.0])
    t = np.arange(10.0)
    run = close_up(t, np.outer(np.ones(4), t))
    figure = rendered(incoherence([panel, panel], dynamics=run))
    axes = figure.axes[0]
    assert colour_at(axes, 2, 0.0) == [tuple(np.round(to_rgb(style.RED), 6))]
    assert colour_at(axes, 3, 0.4) == [tuple(np.round(to_rgb(style.BLUE), 6))]
    assert colour_at(axes, 4, 1.0) == [tuple(np.round(to_rgb(style.BLACK), 6))]
    assert len(figure.axes[2].images) == 1
    assert figure.axes[2].get_title(loc="left") == "(c)"


def test_density_shows_histogram_curve_cuts_and_classes(rendered: Render) -> None:
    values, labels = np.array([0.1, 0.2, 1.0, 2.0]), [0, 0, 1, 2]
    names = ("ordered", "chimera", "disordered")
    grid = np.linspace(0.0, 3.0, 50)
    made = Density(values, grid, np.exp(-grid), [0.5, 1.5], names, labels)
    figure = rendered(density_classes(made, [2, 3, 11, 14]))
    left, right = figure.axes
    areas = sum(bar.get_height() * bar.get_width() for bar in left.patches)
    assert areas == pytest.approx(1.0)
    curve, *cuts = left.lines
    assert same(curve.get_color(), style.RED)
    assert [line.get_xdata()[0] for line in cuts] == [0.5, 1.5]
    for scatter, name in zip(right.collections, names, strict=True):
        assert same(scatter.get_facecolors()[0], style.colour_of(name))
    np.testing.assert_allclose(right.collections[0].get_offsets(), [[2, 0.1], [3, 0.2]])
    labels_shown = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels_shown == ["histogram", "kernel density", "cut", *names]


RING = np.array([(i, (i + k) % 8) for i in range(8) for k in (1, 2, 3)])


def test_network_draws_reoriented_links_in_red(rendered: Render) -> None:
    turned = RING.copy()
    turned[[0, 21]] = turned[[0, 21], ::-1]  # the links 0 - 1 and 7 - 0
    figure = rendered(networks([("ring", RING), ("$Q = 1$", turned)], RING, 8))
    plain, changed = figure.axes
    for axes, count in ((plain, 0), (changed, 2)):
        lines = [c for c in axes.collections if isinstance(c, LineCollection)]
        heads = [c for c in axes.collections if isinstance(c, PolyCollection)]
        assert [len(c.get_paths()) for c in lines] == [24 - count, count]
        assert [len(c.get_paths()) for c in heads] == [24 - count, count]
        assert same(lines[0].get_colors()[0], style.BLACK)
        assert same(lines[1].get_colors()[0], style.RED)
        assert same(heads[1].get_facecolors()[0], style.RED)
    assert [text.get_text() for text in plain.texts] == [str(i) for i in range(8)]


def test_nodes_go_clockwise_from_the_top() -> None:
    np.testing.assert_allclose(circle(4), [[0, 1], [1, 0], [0, -1], [-1, 0]], atol=1e-15)


def test_arrow_points_to_the_head_of_the_link_at_its_middle() -> None:
    tip, left, right = arrow_heads(np.array([[[0.0, 0.0], [2.0, 0.0]]]), 0.2)[0]
    np.testing.assert_allclose(tip, [1.1, 0.0])
    np.testing.assert_allclose([left[0], right[0]], 0.9)
    np.testing.assert_allclose(left[1], -right[1])


def test_large_networks_have_no_numbers(rendered: Render) -> None:
    ring = np.array([(i, (i + 1) % 50) for i in range(50)])
    assert len(rendered(networks([("", ring)], ring, 50)).axes[0].texts) == 0


TRUTH = {"phase": np.zeros(5), "amplitude": np.ones(5), "frequency": np.arange(5.0)}


def shifted(by: float) -> dict[str, np.ndarray]:
    return {name: values + by for name, values in TRUTH.items()}


def test_reconstruction_with_one_method_shows_signed_errors(rendered: Render) -> None:
    figure = rendered(reconstruction(TRUTH, {"three steps": shifted(1e-3)}))
    top, bottom = figure.axes[:3], figure.axes[3:]
    for axes, values in zip(top, TRUTH.values(), strict=True):
        true, found = axes.lines
        assert (true.get_marker(), same(true.get_color(), style.BLACK)) == ("s", True)
        assert same(found.get_color(), style.GREEN)
        np.testing.assert_array_equal(true.get_ydata(), values)
        np.testing.assert_allclose(found.get_ydata(), values + 1e-3)
    for axes in bottom:
        np.testing.assert_allclose(axes.lines[0].get_ydata(), -1e-3)
        assert axes.get_yscale() == "linear"
    assert [axes.get_title(loc="left") for axes in figure.axes] == [f"({c})" for c in "abcdef"]


def test_reconstruction_with_two_methods_shows_sizes_on_a_logarithmic_scale(
    rendered: Render,
) -> None:
    found = {"three steps": shifted(1e-3), "sine fit": shifted(-1e-9)}
    figure = rendered(reconstruction(TRUTH, found))
    for axes in figure.axes[3:]:
        one, two = axes.lines
        np.testing.assert_allclose(one.get_ydata(), 1e-3)
        np.testing.assert_allclose(two.get_ydata(), 1e-9, rtol=1e-6)
        assert axes.get_yscale() == "log"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["true", "three steps", "sine fit"]


@pytest.fixture
def peaked() -> Spectrum:
    frequency = 0.5 * np.arange(12)
    amplitude = 2.0 - (frequency - 2.1) ** 2  # a parabola with its top at (2.1, 2)
    return Spectrum(np.arange(50.0), np.sin(np.arange(50.0)), frequency, amplitude, 4)


def test_vertex_is_that_of_the_parabola(peaked: Spectrum) -> None:
    assert vertex(peaked) == pytest.approx((2.1, 2.0))


def test_spectrum_shows_signal_parabola_and_both_maxima(rendered: Render, peaked: Spectrum) -> None:
    figure = rendered(spectrum(peaked))
    signal, broad, near = figure.axes
    np.testing.assert_array_equal(signal.lines[0].get_ydata(), peaked.y)
    dashed, curve = broad.lines
    assert (dashed.get_linestyle(), same(dashed.get_color(), style.BLUE)) == ("--", True)
    assert same(curve.get_color(), style.RED)
    np.testing.assert_allclose(curve.get_ydata(), 2.0 - (curve.get_xdata() - 2.1) ** 2)
    raw, top = near.lines[2:]
    assert (raw.get_marker(), float(raw.get_xdata()[0])) == ("o", 2.0)
    assert (top.get_marker(), float(top.get_xdata()[0])) == ("s", pytest.approx(2.1))
    labels = [text.get_text() for text in near.get_legend().get_texts()]
    assert labels[2:] == ["(2.0000, 1.9900)", "(2.1000, 2.0000)"]
    assert near.get_xlim()[0] < 2.0 < 2.1 < near.get_xlim()[1]


def test_confusion_matrix_writes_every_count(rendered: Render) -> None:
    counts = np.array([[8, 1, 0], [0, 4, 1], [0, 0, 6]])
    names = ("ordered", "chimera", "disordered")
    figure = rendered(confusion_matrices([Comparison("triplets", "SI", names, counts)]))
    axes = figure.axes[0]
    assert [text.get_text() for text in axes.texts] == [str(n) for n in counts.ravel()]
    assert (axes.get_ylabel(), axes.get_xlabel()) == ("triplets", "SI")
    assert axes.get_title() == "agree: 90.0%"


def test_verdicts_mark_cells_where_methods_differ(rendered: Render, colour_at: Any) -> None:
    methods = {
        "triplets": ["ordered", "chimera", None],
        "SI": ["ordered", "disordered", "ordered"],
    }
    figure = rendered(verdicts([2, 3, 4], methods))
    axes = figure.axes[0]
    bars = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in axes.patches]
    assert bars == [(2.5, 3.5), (3.5, 4.5)]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["triplets", "SI"]
    assert colour_at(axes, 3, 0) == [tuple(np.round(to_rgb(style.BLUE), 6))]
    assert colour_at(axes, 3, 1) == [tuple(np.round(to_rgb(style.BLACK), 6))]
    assert colour_at(axes, 4, 0) == []
    letters = {"triplets": ["A", "B", "B"], "SI": ["ordered"] * 3, "ACM": ["ordered"] * 3}
    assert list(rendered(verdicts([2, 3, 4], letters)).axes[0].patches) == []


def test_agreement_matrix_has_a_number_in_each_known_field(rendered: Render) -> None:
    values = np.array([[np.nan, 0.5, np.nan], [0.25, np.nan, -0.1], [1.0, 0.0, np.nan]])
    axes = rendered(agreement_matrix(["SI", "ACM", "plateau"], values)).axes[0]
    shown = {text.get_position(): text.get_text() for text in axes.texts}
    assert shown[(0, 1)] == "0.25"
    assert shown[(2, 1)] == "-0.10"
    assert len(shown) == 5
    assert [text.get_text() for text in axes.get_xticklabels()] == ["SI", "ACM", "plateau"]


def test_verdict_maps_show_the_share_that_agrees(rendered: Render) -> None:
    plane = [("$P$", [2, 2, 3, 3]), ("$Q$", [0, 1, 0, 1])]
    methods = {
        "SI": ["ordered", "chimera", "ordered", None],
        "ACM": ["ordered", "ordered", "ordered", "chimera"],
    }
    *maps, share, _ = rendered(verdict_maps(plane, methods)).axes
    assert [axes.get_title() for axes in maps] == ["SI", "ACM"]
    assert share.get_xticks().tolist() == maps[0].get_xticks().tolist()
    (mesh,) = share.collections
    np.testing.assert_array_equal(mesh.get_array(), [[1.0, 1.0], [0.5, 1.0]])
    *_, share, _ = rendered(verdict_maps(plane, {"triplets": list("ABAB"), **methods})).axes
    np.testing.assert_array_equal(share.collections[0].get_array(), [[1.0, 1.0], [0.5, 1.0]])


def test_class_number_marks_the_answer_of_each_measure(rendered: Render) -> None:
    entry = {
        "gap": [0.1, 0.5, 0.4],
        "gap_error": [0.1, 0.1, 0.1],
        "silhouette": [None, 0.8, 0.4],
        "stability": [1.0, 0.99, 0.5],
        "by": {"gap statistic": 2, "silhouette": 2, "stability": 2},
    }
    axes = rendered(class_number(entry)).axes
    assert [one.get_title("left").split(")")[-1].strip() for one in axes] == [
        "gap statistic: 2",
        "silhouette: 2",
        "stability: 2",
    ]
    assert axes[1].lines[0].get_ydata()[1:].tolist() == [0.8, 0.4]
    assert axes[0].lines[-1].get_xdata() == [2, 2]
