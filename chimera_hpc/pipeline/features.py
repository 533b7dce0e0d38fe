"""From runs to profiles: phase, amplitude and frequency of every node."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin

from chimera_hpc.measures.analytic import hilbert_features, wavelet_features
from chimera_hpc.measures.conventions import preset_settings
from chimera_hpc.measures.fourier import measure_signals
from chimera_hpc.pipeline.runs import SignalRun, signal_runs

Array = NDArray[np.float64]
PROFILES = ("phase", "amplitude", "frequency")


class Stateless(TransformerMixin, BaseEstimator):  # type: ignore[misc, unused-ignore]
    """A transformer of runs, or of what was measured of them, that has nothing to learn."""

    def fit(self, X: Any, y: Any = None) -> Self:
        """Do nothing: each run is measured for itself."""
        return self

    def __sklearn_is_fitted__(self) -> bool:
        return True

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.requires_fit = False
        tags.input_tags.two_d_array, tags.input_tags.three_d_array = False, True
        tags.input_tags.allow_nan = True
        return tags


class RunTransformer(Stateless):
    """A transformer that takes each run for itself."""

    step: float

    def transform(self, X: Any) -> Any:
        """Return an array with a row per run, or a list where rows differ in length."""
        rows = [self.measure(run) for run in signal_runs(X, self.step)]
        same = len({np.shape(row) for row in rows}) <= 1
        return np.array(rows) if same else rows

    def measure(self, run: SignalRun) -> ArrayLike:
        """Return the numbers of one run."""
        raise NotImplementedError


class ProfileTransformer(RunTransformer):
    """A transformer to profiles (runs, 3, nodes)."""

    def set_output(self, *, transform: str | None = None) -> Self:
        """Change nothing: profiles stay arrays, as no data frame holds three dimensions."""
        return self


class FourierFeatures(ProfileTransformer):
    """Phase, amplitude and frequency of every node by the Fourier line in windows.

    As `chimera_hpc.fourier_features`, by which a sweep is measured. The result is an array (runs,
    3, nodes) with the rows `PROFILES`, or a list of such arrays where runs differ in nodes; NaN
    for a run that does not oscillate (with steady = "level", its levels).

    Parameters
    ----------
    preset : {"default", "paper-printed"}
        Sets the parameters below that are None.
    n_peaks, n_overlap, max_windows, prominence, window_reference, reference_node, phase_mean, \
refine, time_origin, steady, steady_threshold
        As in `chimera_hpc.fourier_features`.
    step : float
        Time between two samples of runs that have no times.

    Examples
    --------
    >>> t = 0.01 * np.arange(5000)
    >>> u = np.cos(2 * np.pi * t[:, None] + [0.0, 1.0, 2.0])
    >>> phase, amplitude, frequency = FourierFeatures().fit_transform([(t, u)])[0]
    >>> (phase - phase[0]).round(2), frequency.round(3)
    (array([0., 1., 2.]), array([1., 1., 1.]))
    """

    def __init__(
        self,
        preset: str = "default",
        *,
        n_peaks: int = 10,
        n_overlap: int = 5,
        max_windows: int | None = None,
        prominence: float | None = None,
        window_reference: str | None = None,
        reference_node: int = 0,
        phase_mean: str | None = None,
        refine: str | None = None,
        time_origin: str | None = None,
        steady: str | None = None,
        steady_threshold: float = 1e-2,
        step: float = 1.0,
    ) -> None:
        self.preset = preset
        self.n_peaks = n_peaks
        self.n_overlap = n_overlap
        self.max_windows = max_windows
        self.prominence = prominence
        self.window_reference = window_reference
        self.reference_node = reference_node
        self.phase_mean = phase_mean
        self.refine = refine
        self.time_origin = time_origin
        self.steady = steady
        self.steady_threshold = steady_threshold
        self.step = step

    def options(self) -> dict[str, Any]:
        """Return the keyword arguments of `chimera_hpc.fourier_features`."""
        given = self.get_params(deep=False)
        own = {k: v for k, v in given.items() if v is not None and k not in ("preset", "step")}
        return {**preset_settings(self.preset), **own}

    def measure(self, run: SignalRun) -> Array:
        """Return the profiles of one run, (3, N)."""
        found = measure_signals(run.t, run.u, **self.options())
        return np.stack([found.phase, found.heights, found.frequency])


class HilbertFeatures(ProfileTransformer):
    """Phase, amplitude and frequency of every node by its analytic signal.

    As `chimera_hpc.measures.hilbert_features`; the result is that of `FourierFeatures`.
    """

    def __init__(self, *, reference_node: int = 0, step: float = 1.0) -> None:
        self.reference_node = reference_node
        self.step = step

    def measure(self, run: SignalRun) -> Array:
        """Return the profiles of one run, (3, N)."""
        return np.stack(hilbert_features(run.t, run.u, reference_node=self.reference_node))


class WaveletFeatures(ProfileTransformer):
    """Phase, amplitude and frequency of every node along the ridge of a Morlet transform.

    As `chimera_hpc.measures.wavelet_features`; the result is that of `FourierFeatures`.
    """

    def __init__(
        self,
        *,
        low: float | None = None,
        high: float | None = None,
        reference_node: int = 0,
        step: float = 1.0,
    ) -> None:
        self.low = low
        self.high = high
        self.reference_node = reference_node
        self.step = step

    def measure(self, run: SignalRun) -> Array:
        """Return the profiles of one run, (3, N)."""
        node = self.reference_node
        made = wavelet_features(run.t, run.u, low=self.low, high=self.high, reference_node=node)
        return np.stack(made)
