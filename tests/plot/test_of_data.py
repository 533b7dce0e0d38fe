"""Figures of what `chimera_hpc.open` gives, and of runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from chimera_hpc import plot
from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.fourier import FEATURES

N_NODES = 6
TIME = 0.05 * np.arange(400)


def sweep(*, reduced: bool = True) -> xr.Dataset:
    """Two seeds of P = 2, 3, 4, each P of another class."""
    draw = np.random.default_rng(0)
    half_degree = np.repeat([2, 3, 4], 2)
    u = np.cos(2 * np.pi * TIME[:, None] + draw.uniform(0, 6, (6, 1, N_NODES)))
    data: dict[str, Any] = {"u": (("point", "time", "node"), u)}
    data |= {name: (("point", "node"), draw.random((6, N_NODES))) for name in FEATURES}
    data |= {name: ("point", draw.random(6)) for name in ("V_theta", "V_a", "V_Omega")}
    if reduced:
        names = np.repeat(["ordered", "chimera", "steady"], 2)
        data |= {"class_3": ("point", names), "modal_class_3": ("point", names)}
    points = {"P": half_degree, "Q": half_degree, "seed": np.tile([0, 1], 3)}
    coords: dict[str, Any] = {name: ("point", column) for name, column in points.items()}
    return xr.Dataset(data, {**coords, "cell": ("point", half_degree - 2), "time": TIME})


def titles(figure: Any) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]


def test_runs_of_a_dataset_are_chosen_by_coordinates_or_by_class() -> None:
    chosen = titles(plot.space_time(sweep(), P=[2, 4], seed=1))
    assert [text.splitlines()[0] for text in chosen[:2]] == [
        "(a)  $P$ = 2, $seed$ = 1",
        "(b)  $P$ = 4, $seed$ = 1",
    ]
    by_class = [text.splitlines()[1] for text in titles(plot.space_time(sweep()))[:3]]
    assert by_class == ["chimera", "ordered", "steady"]
    columns = titles(plot.profiles(sweep(), seed=0))
    assert len(columns) == 3


def test_runs_without_a_dataset() -> None:
    t, u = TIME, np.asarray(sweep().u)
    for runs, count in (((t, u[0]), 1), ([(t, one) for one in u[:2]], 2), (u[:3], 3)):
        panels = [axes for axes in plot.space_time(runs, step=0.05).axes if axes.get_xlabel()]
        assert len(panels) == count
    made: Any = plot.profiles((t, u[0]), titles=["one"])
    assert made._repr_png_().startswith(b"\x89PNG")  # as a notebook shows it
    assert made.axes[0].get_title() == "one"


def test_variations_and_classes() -> None:
    def legend(figure: Any) -> list[str]:
        return [text.get_text() for text in figure.legends[0].get_texts()]

    assert legend(plot.variations(sweep())) == ["ordered", "chimera", "steady"]
    triplets = np.random.default_rng(1).random((4, 3))
    assert legend(plot.variations(triplets, ["A", "B", None, "A"])) == ["A", "B"]
    drawn = plot.classes(sweep(), clusters=3).axes[0]
    assert drawn.get_xlabel() == "$P$"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot.space_time(sweep(), p=2), "p: the dataset has P, Q, seed"),
        (lambda: plot.space_time(sweep(), P=9), "no run has P = 9"),
        (lambda: plot.space_time([], P=9), "P: runs have no coordinates"),
        (lambda: plot.classes(sweep(), clusters=4), "it has cuts into 3"),
        (lambda: plot.classes(sweep(reduced=False)), "`reduce` makes them"),
        (lambda: plot.classes(sweep().isel(point=[0, 1])), "0 parameters vary"),
    ],
)
def test_bad_input_is_one_clear_line(call: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        call()
