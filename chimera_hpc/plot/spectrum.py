"""From the discrete spectrum to its parabola (paper fig. 9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.plot import style
from chimera_hpc.plot.figure_input import FigureInput


def spectrum_figure(data: FigureInput) -> Figure | None:
    """Draw one window, its spectrum and the parabola (paper fig. 9)."""
    entry = data.curves.get("spectrum")
    if entry is None:
        return None
    keys = ("t", "y", "frequency", "amplitude", "peak")
    return spectrum(Spectrum(**{key: entry[key] for key in keys}))


@dataclass(frozen=True)
class Spectrum:
    """One window of one node, its amplitude spectrum, and the parabola through three points."""

    t: ArrayLike
    """(T,)"""
    y: ArrayLike
    """(T,)"""
    frequency: ArrayLike
    """(K,) frequencies of the discrete spectrum, equally spaced."""
    amplitude: ArrayLike
    """(K,)"""
    peak: int
    """Index of the largest amplitude, with a neighbour to each side."""
    fit: ArrayLike | None = None
    """(T,) The line that was fitted to the signal."""

    @property
    def has_parabola(self) -> bool:
        """Whether a parabola is put through the peak: not at the edges of the spectrum.

        The lower neighbour of bin 1 is the mean, which was subtracted.
        """
        return 1 < self.peak < len(np.asarray(self.frequency)) - 1


@style.styled
def spectrum(data: Spectrum, title: str = "") -> Figure:
    """Draw (a) signal and fit, (b) spectrum and parabola, (c) both maxima enlarged."""
    figure, axes = style.new_panels(3, style.PAGE + 0.4, 2.5)
    axes[0].plot(data.t, data.y, color=style.BLUE, label="signal")
    if data.fit is not None:
        axes[0].plot(data.t, data.fit, "--", color=style.RED, label="fit")
        low, high = axes[0].get_ylim()
        axes[0].set_ylim(low - 0.18 * (high - low), high)
        axes[0].legend(loc="lower left", fontsize=6.5, ncols=2)
    axes[0].set_title(title)
    axes[0].set_xlabel("time $t$")
    axes[0].set_ylabel("$y(t)$")
    _draw_spectrum(axes[1], data, reach=8.0)
    _draw_spectrum(axes[2], data, reach=1.0)
    _draw_maxima(axes[2], data)
    style.letter(axes)
    return figure


def parabola(data: Spectrum) -> NDArray[np.float64]:
    """Return c2, c1, c0 of the parabola in (frequency - peak frequency) through three points."""
    around = slice(data.peak - 1, data.peak + 2)
    frequency = np.asarray(data.frequency, float)
    offset = frequency[around] - frequency[data.peak]
    return np.polyfit(offset, np.asarray(data.amplitude, float)[around], 2)


def vertex(data: Spectrum) -> tuple[float, float]:
    """Return frequency and amplitude at the top of the parabola."""
    curve = parabola(data)
    offset = -0.5 * curve[1] / curve[0]
    top = float(np.asarray(data.frequency, float)[data.peak] + offset)
    return top, float(np.polyval(curve, offset))


def _draw_spectrum(axes: Axes, data: Spectrum, reach: float) -> None:
    """Draw `reach` steps of the spectrum to each side of its peak."""
    frequency, amplitude = np.asarray(data.frequency, float), np.asarray(data.amplitude, float)
    step = float(frequency[1] - frequency[0])
    centre = float(frequency[data.peak])
    axes.plot(frequency, amplitude, "--o", color=style.BLUE, markersize=2.5, label="FFT")
    if data.has_parabola:
        offset = np.linspace(-1.1 * step, 1.1 * step, 201)
        height = np.polyval(parabola(data), offset)
        axes.plot(centre + offset, height, color=style.RED, label="parabola")
    axes.set_xlim(max(centre - 1.1 * reach * step, 0.0), centre + 1.1 * reach * step)
    axes.set_ylim(0.0, None)
    axes.set_xlabel("frequency (1/time)")
    axes.set_ylabel("amplitude")


def _draw_maxima(axes: Axes, data: Spectrum) -> None:
    frequency = float(np.asarray(data.frequency, float)[data.peak])
    amplitude = float(np.asarray(data.amplitude, float)[data.peak])
    label = f"({frequency:.4f}, {amplitude:.4f})"
    axes.plot(frequency, amplitude, "o", color=style.BLUE, markersize=6.0, label=label)
    if not data.has_parabola:
        axes.legend(loc="upper center", fontsize=6.5)
        return
    top = vertex(data)
    axes.plot(*top, "s", color=style.BLACK, markersize=5.0, label=f"({top[0]:.4f}, {top[1]:.4f})")
    step = float(np.diff(np.asarray(data.frequency, float)[:2])[0])
    reach = max(3.0 * abs(top[0] - frequency), 0.15 * step)
    curve = np.polyval(parabola(data), [-reach, reach])
    low, high = float(min(curve.min(), amplitude)), max(top[1], amplitude)
    axes.set_xlim(frequency - reach, frequency + reach)
    axes.set_ylim(low - 0.15 * (high - low), high + 0.45 * (high - low))
    axes.legend(loc="upper center", fontsize=6.5, ncols=2, columnspacing=1.0, handletextpad=0.3)
