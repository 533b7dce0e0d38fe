"""The ring in motion: nodes on a circle and in the plane (u, w), frame by frame."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.plot import style
from chimera_hpc.plot.portrait import draw_nullcline

SUFFIXES = (".gif", ".mp4")
_DOTS_AN_INCH = 100
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


def animate_ring(
    path: Path,
    t: ArrayLike,
    u: ArrayLike,
    w: ArrayLike,
    *,
    title: str = "",
    nullcline: bool = False,
    frames_a_second: int = 20,
) -> None:
    """Write one frame for each sample of u and w, both (T, N), at the times t (T,).

    On the ring, node 0 is on the right and the others follow counter-clockwise. u moves a node
    outwards and sets its colour. A node has the same colour in the plane (u, w).

    Raises BadInput: as `check_film`.
    """
    check_film(path)
    time, across, along = (np.asarray(x, dtype=np.float64) for x in (t, u, w))
    largest = max(float(np.nanmax(np.abs(across))), 1e-12)
    angle = 2.0 * np.pi * np.arange(across.shape[1]) / across.shape[1]
    kind = PillowWriter if path.suffix == ".gif" else FFMpegWriter
    writer: AbstractMovieWriter = kind(fps=frames_a_second)
    with mpl.rc_context(style.SETTINGS), tempfile.TemporaryDirectory(dir=path.parent) as folder:
        figure = style.new_figure(style.PAGE, 3.4)
        ring, plane = figure.subplots(1, 2)
        colours = {"cmap": "viridis", "vmin": -largest, "vmax": largest}
        nodes = ring.scatter(*_on_ring(angle, across[0], largest), c=across[0], s=22.0, **colours)
        whole = np.linspace(0.0, 2.0 * np.pi, 361)
        ring.plot(np.cos(whole), np.sin(whole), color=style.GREY, linewidth=0.5, zorder=0.5)
        ring.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), aspect="equal")
        ring.set_axis_off()
        plane.plot(across, along, color=style.GREY, linewidth=0.2)
        if nullcline:
            draw_nullcline(plane, 1.05 * largest)
        dots = plane.scatter(across[0], along[0], c=across[0], s=16.0, zorder=3.0, **colours)
        dots.set_edgecolor(style.BLACK)
        dots.set_linewidth(0.4)
        plane.set(xlabel="$u_i$", ylabel="$w_i$")
        figure.colorbar(nodes, ax=ring, label="$u_i(t)$", shrink=0.8, pad=0.02)
        clock = figure.suptitle(f"{title}   t = {time[-1]:.2f}".strip())
        # The layout is computed once, because it takes longer than a frame.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        film = Path(folder) / path.name
        with writer.saving(figure, str(film), _DOTS_AN_INCH):
            for i, moment in enumerate(time):
                nodes.set_offsets(np.column_stack(_on_ring(angle, across[i], largest)))
                dots.set_offsets(np.column_stack([across[i], along[i]]))
                nodes.set_array(across[i])
                dots.set_array(across[i])
                clock.set_text(f"{title}   t = {moment:.2f}".strip())
                writer.grab_frame()
        os.replace(film, path)


def _on_ring(angle: Vector, u: Vector, largest: float) -> tuple[Vector, Vector]:
    radius = 1.0 + _SWING * u / largest
    return radius * np.cos(angle), radius * np.sin(angle)
