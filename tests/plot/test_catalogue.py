"""The figures of a sweep: which are drawn, when, and what is on them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_hex

from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import classify
from chimera_hpc.job.registry import FIGURES, load
from chimera_hpc.plot.agreement import agreement_figure
from chimera_hpc.plot.catalogue import choose, is_figure_name
from chimera_hpc.plot.classification import classification_figure
from chimera_hpc.plot.dendrogram import dendrogram_figure
from chimera_hpc.plot.figure_input import DrawnRun, FigureInput
from chimera_hpc.plot.indicators import indicators_figure
from chimera_hpc.plot.modes import modal_classes, modal_classes_figure
from chimera_hpc.plot.projections import projections_figure
from chimera_hpc.plot.spacetime import space_time_figure, whole_run_figure
from chimera_hpc.plot.style import BLACK, BLUE, RED

CENTRES = np.array([[0.05, 0.01, 0.001], [0.3, 0.1, 0.11], [0.55, 0.02, 0.01]])
NAMES = ("ordered", "chimera", "disordered")
T = np.arange(0.0, 20.0, 0.02)


def run(place="$P = Q = 12$, seed 0", frequency=4.0, **changes):
    u = np.sin(2.0 * np.pi * frequency * T + np.arange(8)[:, None])
    features = np.full((8, 8), 0.1)
    features[1] = frequency
    made = DrawnRun(place, T, u, "disordered", features, np.array([0.575, 0.018, 0.012]))
    return replace(made, **changes)


def outcome(n_axes=1, status=Status.DONE, **changes):
    """Nine cells with two runs each: three cells of each class."""
    rng = np.random.default_rng(0)
    triplets = CENTRES[np.repeat([0, 1, 2], 6)] * rng.uniform(0.9, 1.1, (18, 3))
    oscillates = status is Status.DONE
    triplets[:] = triplets if oscillates else np.nan
    made = classify(triplets, np.full(18, int(status)), cuts=(3, 5))
    classes = [name if oscillates else "steady" for name in np.repeat(NAMES, 3).tolist()]
    cells = [{"class": name, "votes": {name: 2}} for name in classes]
    columns = [("$P = Q$", np.arange(2, 11)), ("$b$", np.tile([0.1, 0.2, 0.3], 3))]
    columns.append(("$c$", np.arange(9.0)))
    axes = columns[:n_axes]
    return FigureInput(made, triplets, axes, {k: cells for k in made.cuts}, **changes)


def colours_of_points(axes):
    return {to_hex(colour) for dots in axes.collections for colour in dots.get_facecolors()}


def test_auto_draws_the_first_cut_in_every_way_and_the_composite_of_each():
    names = list(choose("auto", [4, 3, 5]))
    assert names[:3] == ["space_time", "indicators", "whole_run"]
    assert names[-6:] == [
        "dendrogram_4", "projections_4", "modal_classes_4",
        "classification_4", "classification_3", "classification_5",
    ]  # fmt: skip
    assert names[:-6] == list(FIGURES)


def test_list_of_figures_draws_these_and_no_others():
    chosen = choose(("projections", "space_time", "dendrogram_5", "dendrogram_4"), [3, 5])
    assert list(chosen) == [
        "projections_3", "projections_5", "space_time", "dendrogram_5", "dendrogram_4",
    ]  # fmt: skip
    assert [name for name, make in chosen.items() if make is None] == ["dendrogram_4"]


def test_numbered_figure_shows_that_cut():
    make = choose(("projections_5",), [3, 5])["projections_5"]
    data = outcome()
    (legend,) = make(data).legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == list(data.classification.cuts[5].names)
    assert len(names) == 5


@pytest.mark.parametrize("name", [*FIGURES, "dendrogram_3", "classification_12"])
def test_own_files_are_recognised(name):
    assert is_figure_name(name)


@pytest.mark.parametrize("name", ["dendrogram", "my_notes", "space_time_3", "photo_3"])
def test_files_of_others_are_not_taken_for_own(name):
    assert not is_figure_name(name)


def test_space_time_shows_each_run_over_a_close_up_of_twelve_periods():
    drawn = space_time_figure(outcome(shown=[run("one", 8.0), run("two", 5.0)]))
    images = [axes.get_images()[0] for axes in drawn.axes if axes.get_images()]
    assert len(images) == 4
    starts = [round(float(image.get_extent()[0]), 1) for image in images]
    assert starts == [0.0, 0.0, 18.5, 17.6]  # periods of 0.125 and 0.2


@pytest.mark.parametrize("draw", [space_time_figure, indicators_figure])
def test_titles_of_neighbours_stay_apart(draw):
    drawn = draw(outcome(shown=[run("$P = Q = 21$, $\\epsilon = 0.05$, seed 0")] * 3))
    drawn.draw_without_rendering()
    titles = [text for axes in drawn.axes if (text := axes._left_title).get_text()]
    boxes = [text.get_window_extent() for text in titles]
    assert len(boxes) == (6 if draw is space_time_figure else 3)  # with those of close-ups
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert max(box.x1 for box in boxes) <= drawn.bbox.x1
    assert titles[2].get_text().startswith("(c)  $P = Q = 21$")
    assert "\ndisordered" in titles[2].get_text()


def test_times_of_neighbours_stay_apart():
    drawn = space_time_figure(outcome(shown=[run(t=T + 980.0, frequency=1.17)] * 3))
    drawn.draw_without_rendering()
    panels = [axes for axes in drawn.axes if axes.get_images()]
    boxes = [
        label.get_window_extent()
        for axes in panels
        for place, label in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
        if axes.get_xlim()[0] <= place <= axes.get_xlim()[1]
    ]
    assert len(boxes) > 6
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_indicators_tell_the_variations_and_leave_out_still_runs():
    still = run(features=None, triplet=None)
    drawn = indicators_figure(outcome(shown=[still, run()]))
    assert len(drawn.axes) == 3
    assert (
        drawn.axes[0].get_title().endswith("$(V_\\theta, V_a, V_\\Omega)$ =\n(0.575, 0.018, 0.012)")
    )
    (dots,) = drawn.axes[2].lines
    np.testing.assert_array_equal(dots.get_ydata(), np.full(8, 4.0))


def test_slow_run_beside_a_fast_one_is_drawn_over_half_of_its_series():
    drawn = space_time_figure(outcome(shown=[run("one", 8.0), run("slow", 0.1)]))
    images = [axes.get_images()[0] for axes in drawn.axes if axes.get_images()]
    starts = [round(float(image.get_extent()[0]), 1) for image in images]
    assert starts == [0.0, 0.0, 18.5, 10.0]


def test_still_run_has_no_close_up():
    still = run(features=None, triplet=None, class_name="steady")
    drawn = space_time_figure(outcome(shown=[still]))
    assert sum(bool(axes.get_images()) for axes in drawn.axes) == 1


def test_whole_run_is_drawn_from_its_begin_to_its_end():
    drawn = whole_run_figure(outcome(whole=[run(class_name="")]))
    left, right, *_ = drawn.axes[0].get_images()[0].get_extent()
    assert (left, right) == pytest.approx((T[0], T[-1]), abs=0.02)
    assert drawn.axes[0].get_title() == "$P = Q = 12$, seed 0"


def test_modal_classes_go_against_one_axis_or_over_two():
    line = modal_classes_figure(outcome(1), 3).axes[0]
    assert line.get_xlabel() == "$P = Q$"
    assert [tick.get_text() for tick in line.get_yticklabels()] == list(NAMES)
    plane = modal_classes_figure(outcome(2), 3).axes[0]
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("$P = Q$", "$b$")
    assert colours_of_points(plane) >= {RED, BLUE, BLACK}


def test_sizes_of_votes_have_a_legend():
    drawn = modal_classes_figure(outcome(1), 3)
    (legend,) = drawn.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        f"{share} % of votes".replace(" %", "%") for share in (10, 50, 100)
    ]
    largest = max(dots.get_sizes().max() for dots in drawn.axes[0].collections)
    assert legend.legend_handles[-1].get_markersize() ** 2 == pytest.approx(largest)


def test_map_fills_its_axes_whatever_the_steps_of_its_parameters():
    x = ("$P$", np.tile([1.0, 2.0, 10.0], 2))
    y = ("$b$", np.repeat([0.1, 0.4], 3))
    (axes,) = modal_classes((x, y), ["ordered"] * 5 + [None]).axes
    assert axes.get_xlim() == (0.5, 14.0)
    assert axes.get_ylim() == pytest.approx((-0.05, 0.55))
    (cells,) = [mesh for mesh in axes.collections if isinstance(mesh, QuadMesh)]
    assert cells.get_array().mask.tolist() == [[False] * 3, [False, False, True]]


def test_composite_has_tree_plane_and_classes(rendered):
    for n_axes, label in ((1, ""), (2, "$b$")):
        drawn = rendered(classification_figure(outcome(n_axes), 3))
        tree, plane, classes = drawn.axes
        assert [axes.get_title(loc="left") for axes in drawn.axes] == ["(a)", "(b)", "(c)"]
        words = [text.get_text() for text in drawn.legends[0].get_texts()]
        assert words[:3] == list(NAMES)
        assert len(words) == (6 if n_axes == 1 else 3)
        assert tree.get_xlabel() == "18 runs"
        assert colours_of_points(plane) == {RED, BLUE, BLACK}
        assert classes.get_ylabel() == label


def test_five_classes_are_five_colours():
    plane = classification_figure(outcome(), 5).axes[1]
    assert len(colours_of_points(plane)) == 5


def test_dendrogram_has_the_line_of_its_cut():
    data = outcome()
    for k, cut in data.classification.cuts.items():
        line = dendrogram_figure(data, k).axes[0].lines[0]
        assert line.get_ydata()[0] == cut.depth


@pytest.mark.parametrize(("n_axes", "titles"), [(1, [""]), (2, ["$P = Q = 2$", "$P = Q = 3$"])])
def test_judged_cells_are_diamonds_in_a_panel_for_each_value_of_the_first_axis(n_axes, titles):
    made = outcome(n_axes)
    cells = [{"triplet": CENTRES[i % 3].tolist()} for i in range(9)]
    ground = {"triplets": CENTRES.tolist(), "labels": [0, 1, 2], "names": list(NAMES)}
    curves = {"atlas": {"judges": {"diagonal": cells}, "background": ground}}
    axes = list(made.axes)
    if n_axes == 2:
        axes[0] = ("$P = Q$", np.repeat([2, 3], [4, 5]))
    panels = load(FIGURES["atlas"])(replace(made, curves=curves, axes=axes)).axes[: len(titles)]
    for panel, title in zip(panels, titles, strict=True):
        assert panel.get_title(loc="left").endswith(title)
    diamonds = [len(panel.collections[-1].get_offsets()) for panel in panels]
    assert diamonds == ([9] if n_axes == 1 else [4, 5])


@pytest.mark.parametrize("n_axes", [0, 3])
def test_classes_are_not_drawn_over_no_axis_or_three(n_axes):
    data = outcome(n_axes)
    assert modal_classes_figure(data, 3) is None
    assert classification_figure(data, 3) is None
    assert dendrogram_figure(data, 3) is not None


def test_sweep_without_oscillation_has_its_classes_only():
    data = outcome(status=Status.STEADY)
    for draw in (dendrogram_figure, projections_figure, classification_figure):
        assert draw(data, 3) is None
    rows = modal_classes_figure(data, 3).axes[0].get_yticklabels()
    assert [row.get_text() for row in rows] == ["steady"]


def test_methods_that_name_no_class_alike_have_no_matrix_of_zeros():
    pair = {"rows": "triplets", "columns": "SI", "counts": [[0, 0], [0, 0]]}
    named = {"rows": "SI", "columns": "acm", "counts": [[3, 0], [1, 2]]}
    entry = {"classes": ["ordered", "chimera"], "pairs": [pair, named]}
    figure = agreement_figure(outcome(curves={"agreement": entry}))
    assert [axes.get_ylabel() for axes in figure.axes] == ["SI"]
    entry["pairs"] = [pair]
    assert agreement_figure(outcome(curves={"agreement": entry})) is None


@pytest.mark.parametrize("place", FIGURES.values(), ids=FIGURES)
def test_nothing_to_show_is_no_figure(place):
    assert load(place)(outcome()) is None
