from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from chimera_hpc.plot import style

SCRIPT = """
import importlib, pkgutil, sys
import chimera_hpc.plot
for module in pkgutil.iter_modules(chimera_hpc.plot.__path__):
    importlib.import_module(f"chimera_hpc.plot.{module.name}")
print(*(n for n in ("matplotlib.pyplot", "sklearn", "zarr", "dask") if n in sys.modules))
"""


def luminance(colour: str) -> float:
    return float(np.dot([0.2126, 0.7152, 0.0722], to_rgb(colour)))


def test_classes_have_the_papers_colours() -> None:
    red, blue, black = (to_rgb(style.colour_of(n)) for n in ("ordered", "chimera", "disordered"))
    assert red[0] > 0.6 > 0.3 > max(red[1:])
    assert blue[2] > 0.6 > 0.4 > max(blue[:2])
    assert max(black) < 0.1


def test_classes_differ_by_marker_and_by_lightness() -> None:
    names = ("ordered", "chimera", "disordered", "steady")
    assert len({style.marker_of(name) for name in names}) == 4
    shades = sorted(luminance(style.colour_of(name)) for name in names[1:])
    assert min(np.diff(shades)) > 0.15
    assert luminance(style.colour_of("steady")) > 0.6


@pytest.mark.parametrize("family", ["ordered", "chimera", "disordered"])
def test_sub_classes_are_light_and_dark_variants_with_one_marker(family: str) -> None:
    first, second = f"{family}-1", f"{family}-2"
    assert abs(luminance(style.colour_of(first)) - luminance(style.colour_of(second))) > 0.2
    assert style.marker_of(first) == style.marker_of(second) == style.marker_of(family)


def test_names_of_users_have_a_look_of_their_own() -> None:
    assert style.colour_of("multi-chimera") == style.TEAL
    assert style.colour_of("spirals") == style.colour_of("spirals")
    assert style.colour_of("class-1") != style.colour_of("class-2")


def test_names_are_sorted_by_class_then_number() -> None:
    names = ["steady", "disordered", "ordered-10", "chimera", "ordered-2", "spirals", "chimera"]
    expected = ["ordered-2", "ordered-10", "chimera", "disordered", "spirals", "steady"]
    assert style.in_order(names) == expected


def test_panels_are_lettered_before_their_titles() -> None:
    axes = Figure().subplots(1, 2)
    axes[0].set_title("first")
    style.letter(list(axes))
    assert [frame.get_title(loc="left") for frame in axes] == ["(a)  first", "(b)"]
    assert axes[0].get_title() == ""


def test_single_panel_is_not_lettered() -> None:
    axes = Figure().subplots()
    axes.set_title("alone")
    style.letter([axes])
    assert (axes.get_title(), axes.get_title(loc="left")) == ("alone", "")


def test_save_writes_png_and_pdf_with_equal_bytes_for_equal_figures(tmp_path: Path) -> None:
    paths = []
    for name in ("one.v2", "two.v2"):
        figure = style.new_figure()
        figure.subplots().plot([0, 1], [0, 1])
        paths.append(style.save(figure, tmp_path / name))
    assert [path.name for path in paths[0]] == ["one.v2.png", "one.v2.pdf"]
    for one, two in zip(*paths, strict=True):
        assert one.stat().st_size > 1000
        assert one.read_bytes() == two.read_bytes()
    assert paths[0][0].read_bytes().startswith(b"\x89PNG")
    assert paths[0][1].read_bytes().startswith(b"%PDF")


def test_settings_of_figures_leave_no_trace() -> None:
    @style.styled
    def make() -> Figure:
        assert mpl.rcParams["font.size"] == 8.0
        return style.new_figure()

    before = dict(mpl.rcParams)
    make()
    assert dict(mpl.rcParams) == before


def test_plot_functions_keep_clear_of_pyplot_and_heavy_libraries() -> None:
    run = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
