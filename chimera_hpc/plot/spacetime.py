"""Space-time plots of u: node against time (paper fig:9dyn, fig:orient1_otherdyn and others)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import DrawnRun, FigureInput

Panel = tuple[ArrayLike, ArrayLike]


def space_time_figure(data: FigureInput) -> Figure | None:
    """Draw u over node and time for the runs to show, with a close-up (paper fig:9dyn)."""
    if not data.shown:
        return None
    fast = any(run.is_fast for run in data.shown)
    return _of_runs(data.shown, [run.close_up for run in data.shown] if fast else None)


def whole_run_figure(data: FigureInput) -> Figure | None:
    """Draw u from t = 0 on for the runs to replay (paper fig:dynamics_P=1)."""
    return _of_runs(data.whole) if data.whole else None


def _of_runs(runs: Sequence[DrawnRun], zoom: Sequence[float] | None = None) -> Figure:
    return space_time([(run.t, run.u) for run in runs], [run.title for run in runs], zoom=zoom)


@style.styled
def space_time(
    panels: Sequence[Panel],
    titles: Sequence[str] = (),
    *,
    columns: int = 3,
    zoom: float | Sequence[float] | None = None,
    symbol: str = "u_i(t)",
) -> Figure:
    """Draw one panel for each (t, u): t (T,) uniform, u (T, N); one colour scale for all.

    `zoom` adds below each panel its last `zoom` time units, the same for all or one for each: fast
    oscillations blur in print when the window holds more periods than the panel has dots.
    """
    columns = 2 if len(panels) == 4 and columns > 2 else min(columns, len(panels))
    closer = [zoom] * len(panels) if zoom is None or isinstance(zoom, int | float) else list(zoom)
    rows = -(-len(panels) // columns)
    parts = 1 if zoom is None else 2
    width = style.PAGE if columns > 1 else style.COLUMN + 0.6
    figure = style.new_figure(width, 0.35 + 1.95 * rows * parts)
    axes = figure.subplots(rows * parts, columns, squeeze=False, sharey=True)
    largest = max(float(np.nanmax(np.abs(np.asarray(u)))) for _, u in panels)
    for i, panel in enumerate(panels):
        row, column = parts * (i // columns), i % columns
        image = draw_u(axes[row, column], *panel, largest)
        axes[row, column].set_title(titles[i] if i < len(titles) else "")
        if (duration := closer[i]) is not None:
            draw_u(axes[row + 1, column], *last_part(*panel, duration), largest)
    for empty in (
        axes.reshape(rows, parts, columns).swapaxes(1, 2).reshape(-1, parts)[len(panels) :]
    ):
        for spare in empty:
            spare.set_axis_off()
    style.letter([axes[parts * (i // columns), i % columns] for i in range(len(panels))])
    for left in axes[:, 0]:
        left.set_ylabel("node $i$")
    for bottom in axes[-1]:
        bottom.set_xlabel("time $t$")
    figure.colorbar(image, ax=axes, label=f"${symbol}$", fraction=0.03, pad=0.01)
    return figure


def last_part(
    t: ArrayLike, u: ArrayLike, duration: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the samples of the last `duration` time units."""
    time = np.asarray(t, dtype=np.float64)
    kept = time >= time[-1] - duration
    return time[kept], np.asarray(u, dtype=np.float64)[kept]


def draw_u(axes: Axes, t: ArrayLike, u: ArrayLike, largest: float) -> AxesImage:
    """Draw u (T, N), time along x and node 1 at the bottom; colours from -largest to largest."""
    time = np.asarray(t, dtype=np.float64)
    values = np.asarray(u, dtype=np.float64)
    half = 0.5 * (time[1] - time[0]) if len(time) > 1 else 0.5
    # Few labels, so that those of neighbouring panels stay apart.
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    return axes.imshow(
        values.T,
        aspect="auto",
        origin="lower",
        extent=(time[0] - half, time[-1] + half, 0.5, values.shape[1] + 0.5),
        vmin=-largest,
        vmax=largest,
        cmap="viridis",
        interpolation_stage="data",
    )
