"""Dendrograms, projections, modal classes and the figures made of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from chimera_hpc.plot import style
from chimera_hpc.plot.dendrogram import brackets, dendrogram
from chimera_hpc.plot.modes import modal_classes
from chimera_hpc.plot.projections import projections

Render = Callable[[Figure], Figure]

# Leaves 0, 1 merge at 1, leaves 2, 3 at 2, all at 5.
LINKAGE = np.array([[0, 1, 1.0, 2], [2, 3, 2.0, 2], [4, 5, 5.0, 4]])
LEAVES = np.array([0, 0, 1, 1])
NAMES = ("ordered", "chimera")
TRIPLETS = np.array([[0.1, 0.01, 0.0], [0.1, 0.02, 0.0], [0.3, 0.1, 0.2], [0.3, 0.1, 0.21]])


def rgb(name: str) -> tuple[float, ...]:
    return tuple(np.round(to_rgb(style.colour_of(name)), 6))


def test_brackets_by_hand() -> None:
    corners, label = brackets(LINKAGE, LEAVES)
    assert label.tolist() == [0, 1, -1]
    np.testing.assert_array_equal(corners[0], [[0, 0], [0, 1], [1, 1], [1, 0]])
    np.testing.assert_array_equal(corners[1], [[2, 0], [2, 2], [3, 2], [3, 0]])
    np.testing.assert_array_equal(corners[2], [[0.5, 1], [0.5, 5], [2.5, 5], [2.5, 2]])


def test_leaves_are_placed_without_crossings() -> None:
    linkage = np.array([[0, 2, 1.0, 2], [1, 3, 2.0, 2], [4, 5, 5.0, 4]])
    corners, _ = brackets(linkage, LEAVES)
    assert corners[0][:, 0].max() < corners[1][:, 0].min()


def test_dendrogram_colours_merges_by_class_and_draws_the_cut(rendered: Render) -> None:
    figure = rendered(dendrogram(LINKAGE, LEAVES, NAMES, 3.5))
    axes = figure.axes[0]
    by_label = {lines.get_label(): lines for lines in axes.collections}
    for name in NAMES:
        lines = by_label[name]
        assert len(lines.get_segments()) == 1
        assert tuple(np.round(lines.get_colors()[0][:3], 6)) == rgb(name)
    assert len(by_label["above the cut"].get_segments()) == 1
    (cut,) = axes.lines
    assert set(cut.get_ydata()) == {3.5}
    assert axes.get_title(loc="right") == "cut at $d$ = 3.5"
    assert axes.get_ylim()[1] > 5.0
    assert axes.get_xlabel() == "4 runs"


def test_dendrogram_of_one_run_and_of_none(rendered: Render) -> None:
    for n, names in ((1, ("ordered",)), (0, ())):
        leaves = np.zeros(n, dtype=np.int64)
        figure = rendered(dendrogram(np.empty((0, 4)), leaves, names, 0.0))
        assert sum(len(lines.get_segments()) for lines in figure.axes[0].collections) == 0


def test_projections_show_three_planes_and_a_solid(rendered: Render) -> None:
    figure = rendered(projections(TRIPLETS, [0, 0, 1, -1], NAMES))
    flat, solid = figure.axes[:3], figure.axes[3]
    pairs = [(axes.get_xlabel()[:5], axes.get_ylabel()[:5]) for axes in flat]
    theta, a, omega = r"$V_\theta$"[:5], "$V_a$", r"$V_\Omega$"[:5]
    assert pairs == [(theta, a), (theta, omega), (a, omega)]
    assert solid.name == "3d"
    for axes, (x, y) in zip(flat, ((0, 1), (0, 2), (1, 2)), strict=True):
        ordered, chimera = axes.collections
        np.testing.assert_allclose(ordered.get_offsets(), TRIPLETS[:2][:, [x, y]])
        np.testing.assert_allclose(chimera.get_offsets(), TRIPLETS[2:3][:, [x, y]])
        assert tuple(np.round(ordered.get_facecolors()[0][:3], 6)) == rgb("ordered")
        assert tuple(np.round(chimera.get_facecolors()[0][:3], 6)) == rgb("chimera")
    assert sum(len(c.get_offsets()) for c in solid.collections) == 3


def test_many_runs_are_small_and_translucent_and_legends_cover_none(rendered: Render) -> None:
    looks = []
    for n in (20_000, 20_001, 100_000):
        triplets = np.random.default_rng(0).random((n, 3))
        figure = projections(triplets, np.arange(n) % 2, NAMES)
        marks = figure.axes[0].collections[0]
        looks.append((float(marks.get_sizes()[0]), marks.get_alpha()))
        assert [axes.get_legend() for axes in figure.axes] == [None] * 4
        assert len(figure.legends) == 1
    assert looks[0] == (11.0, 0.75)
    assert looks[1] == (2.0, pytest.approx(0.5, abs=1e-3))
    assert looks[2] == (2.0, pytest.approx(0.1))
    assert [text.get_text() for text in rendered(figure).legends[0].get_texts()] == [*NAMES]


def test_class_against_puts_each_class_in_its_row(rendered: Render, colour_at: Any) -> None:
    classes = ["steady", "ordered", "disordered", None, "chimera"]
    figure = rendered(modal_classes([("$P = Q$", [2, 3, 4, 5, 6])], classes))
    axes = figure.axes[0]
    rows = [text.get_text() for text in axes.get_yticklabels()]
    assert rows == ["steady", "ordered", "chimera", "disordered"]
    assert axes.get_xlabel() == "$P = Q$"
    for x, name in zip([2, 3, 4, 6], ["steady", "ordered", "disordered", "chimera"], strict=True):
        assert colour_at(axes, x, rows.index(name)) == [rgb(name)]
    assert not any(colour_at(axes, 5, row) for row in range(4))


def test_votes_are_discs_with_area_by_share() -> None:
    votes = [{"ordered": 15, "chimera": 5}, {"chimera": 20}]
    axes = modal_classes([("$P$", [1, 2])], ["ordered", "chimera"], votes).axes[0]
    discs = {
        tuple(c.get_offsets()[0]): float(c.get_sizes()[0])
        for c in axes.collections
        if c.get_zorder() == 1.0
    }
    full = discs[(2.0, 1.0)]
    assert discs == pytest.approx(
        {(1.0, 0.0): 0.75 * full, (1.0, 1.0): 0.25 * full, (2.0, 1.0): full}
    )


def test_class_map_colours_every_cell(rendered: Render, colour_at: Any) -> None:
    p, q = [3, 3, 4, 4, 5], [0, 3, 0, 4, 2]
    classes = ["steady", "ordered", "chimera", "disordered-2", None]
    figure = rendered(modal_classes([("$P$", p), ("$Q$", q)], classes))
    axes = figure.axes[0]
    for x, y, name in list(zip(p, q, classes, strict=True))[:4]:
        assert colour_at(axes, x, y) == [rgb(name)]
    assert colour_at(axes, 5, 2) == []
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$P$", "$Q$")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["ordered", "chimera", "disordered-2", "steady"]


def test_legend_of_many_classes_fits_a_narrow_figure(rendered: Render) -> None:
    classes = ["ordered-1", "ordered-2", "chimera-1", "disordered-1", "disordered-2", "steady"]
    figure = rendered(modal_classes([("$P$", range(6)), ("$Q$", range(6))], classes))
    assert len(figure.legends[0].get_texts()) == 6
