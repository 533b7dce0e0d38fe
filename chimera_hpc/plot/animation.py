"""A run in motion: its ring or network, and the plane (u, w), frame by frame."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.colors import Normalize
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.plot import style
from chimera_hpc.plot.network_state import Drawing
from chimera_hpc.plot.portrait import draw_nullcline

SUFFIXES = (".gif", ".mp4")
_DOTS_AN_INCH = 100
_COLOURS = "viridis"
Vector: TypeAlias = NDArray[np.float64]
_SWING = 0.3
"""How far the largest |u| moves a node out of the circle, in radii."""


def check_film(path: Path) -> None:
    """Raise BadInput unless a film of this name can be written here."""
    if path.suffix not in SUFFIXES:
        raise BadInput(f"{path}: allowed endings are {' and '.join(SUFFIXES)}")
    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise BadInput(f"{path}: an MP4 needs the program ffmpeg, which is not here; .gif does not")
    if not path.absolute().parent.is_dir():
        raise BadInput(f"{path}: no such folder")


def animate(
    path: Path,
    t: ArrayLike,
    u: ArrayLike,
    w: ArrayLike,
    *,
    drawing: Drawing | None = None,
    title: str = "",
    nullcline: bool = False,
    frames_a_second: int = 20,
) -> None:
    """Write one frame for each sample of u and w, both (T, N), at the times t (T,).

    u sets the colours, in the plane (u, w) too. Without a drawing of a network the nodes are those
    of a ring, node 0 on the right and the others counter-clockwise, and u moves them outwards.

    Raises BadInput: as `check_film`.
    """
    check_film(path)
    time, across, along = (np.asarray(x, dtype=np.float64) for x in (t, u, w))
    largest = max(float(np.nanmax(np.abs(across))), 1e-12)
    scale = Normalize(-largest, largest)
    kind = PillowWriter if path.suffix == ".gif" else FFMpegWriter
    writer: AbstractMovieWriter = kind(fps=frames_a_second)
    with mpl.rc_context(style.SETTINGS), tempfile.TemporaryDirectory(dir=path.parent) as folder:
        figure = style.new_figure(style.PAGE, 3.4)
        left, plane = figure.subplots(1, 2)
        if drawing is None:
            shown, move = _draw_ring(left, across[0], scale)
        else:
            shown, move = _draw_network(left, across[0], scale, drawing)
        move_dots = _draw_plane(plane, across, along, scale, nullcline)
        figure.colorbar(shown, ax=left, label="$u_i(t)$", shrink=0.8, pad=0.02)
        clock = figure.suptitle(f"{title}   t = {time[-1]:.2f}".strip())
        # The layout is computed once, because it takes longer than a frame.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        film = Path(folder) / path.name
        with writer.saving(figure, str(film), _DOTS_AN_INCH):
            for i, moment in enumerate(time):
                move(across[i])
                move_dots(across[i], along[i])
                clock.set_text(f"{title}   t = {moment:.2f}".strip())
                writer.grab_frame()
        os.replace(film, path)


Move: TypeAlias = Callable[[Vector], None]


def _draw_network(
    axes: Axes, u: Vector, scale: Normalize, drawing: Drawing
) -> tuple[Collection, Move]:
    """Draw a network; return what u colours, and what shows another u."""
    shown = drawing.draw_values(axes, u, scale, _COLOURS)
    return shown, lambda u: shown.set_array(u[drawing.shown])


def _draw_ring(axes: Axes, u: Vector, scale: Normalize) -> tuple[Collection, Move]:
    """Draw a ring; return its nodes, and what moves them."""
    angle, largest = 2.0 * np.pi * np.arange(len(u)) / len(u), scale.vmax or 1.0

    def places(u: Vector) -> Vector:
        radius = 1.0 + _SWING * u / largest
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])

    def move(u: Vector) -> None:
        nodes.set_offsets(places(u))
        nodes.set_array(u)

    x, y = places(u).T
    nodes = axes.scatter(x, y, c=u, s=22.0, cmap=_COLOURS, norm=scale)
    whole = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(whole), np.sin(whole), color=style.GREY, linewidth=0.5, zorder=0.5)
    axes.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
    axes.set_axis_off()
    return nodes, move


def _draw_plane(
    axes: Axes, u: Vector, w: Vector, scale: Normalize, nullcline: bool
) -> Callable[[Vector, Vector], None]:
    """Draw the orbits of u, w (T, N) and a dot on each; return what moves the dots."""
    axes.plot(u, w, color=style.GREY, linewidth=0.2)
    if nullcline:
        draw_nullcline(axes, 1.05 * float(np.nanmax(np.abs(u))))
    dots = axes.scatter(u[0], w[0], c=u[0], s=16.0, cmap=_COLOURS, norm=scale, zorder=3.0)
    dots.set_edgecolor(style.BLACK)
    dots.set_linewidth(0.4)
    axes.set(xlabel="$u_i$", ylabel="$w_i$")

    def move(u: Vector, w: Vector) -> None:
        dots.set_offsets(np.column_stack([u, w]))
        dots.set_array(u)

    return move
