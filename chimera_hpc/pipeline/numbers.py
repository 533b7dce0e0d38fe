"""From profiles or runs to a few numbers per run: total variations, panels of measures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import hilbert

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.classification import TRIPLET
from chimera_hpc.job.registry import MEASURES, OTHER_NAMES, measures
from chimera_hpc.job.selection import check_name
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.fourier import measure_signals
from chimera_hpc.measures.measure import MeasuredRun
from chimera_hpc.measures.variation import total_variation_arrays
from chimera_hpc.pipeline.features import PROFILES, RunTransformer, Stateless
from chimera_hpc.pipeline.runs import SignalRun


class TotalVariation(Stateless):
    """Total variations (V_theta, V_a, V_Omega) of profiles, as `chimera_hpc.total_variations`.

    X is what `FourierFeatures` gives, profiles (runs, 3, nodes); the result is an array (runs, 3),
    NaN for a run that does not oscillate.

    Parameters
    ----------
    pairs : "ring", "chain", or array_like of int, shape (M, 2)
        Pairs of nodes over which the sums are taken.

    Examples
    --------
    >>> profiles = [[[0.0, np.pi / 2, np.pi], [1.0, 3.0, 2.0], [4.0, 4.0, 1.0]]]
    >>> TotalVariation().fit_transform(profiles)
    array([[0.666667, 1.333333, 2.      ]])
    """

    def __init__(self, pairs: str | ArrayLike = "ring") -> None:
        self.pairs = pairs

    def transform(self, X: Any) -> NDArray[np.float64]:
        """Return the triplets of runs, (runs, 3)."""
        where = _pairs(self.pairs)
        if not hasattr(X, "__len__") or hasattr(X, "tocsr"):
            raise BadInput(f"profiles are a list or an array, not {type(X).__name__}")
        found = [total_variation_arrays(*_checked(row), **where) for row in X]
        return np.array(found, dtype=np.float64).reshape(-1, 3)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Return the names of the columns."""
        return np.array(TRIPLET, dtype=object)


def _pairs(pairs: str | ArrayLike) -> dict[str, Any]:
    if not isinstance(pairs, str):
        return {"pairs": pairs}
    if pairs not in ("ring", "chain"):
        raise BadInput(f'pairs is {pairs!r}; allowed: "ring", "chain" or an array (M, 2)')
    return {"ring": pairs == "ring"}


def _checked(row: Any) -> NDArray[np.float64]:
    profiles = np.asarray(row, dtype=np.float64)
    if profiles.ndim != 2 or len(profiles) != len(PROFILES):
        raise BadInput(f"profiles of a run have the shape (3, nodes), not {profiles.shape}")
    return profiles


class Panel(RunTransformer):
    """Numbers of a panel of measures, as ``[measures] panel`` of a job.

    X is runs, as for `FourierFeatures`; the result is an array (runs, numbers). Without w, the
    Hilbert transform of u takes its place.

    Parameters
    ----------
    names : sequence of str
        Measures, such as "order" or "g0h0".
    pairs : array_like of int, shape (M, 2), optional
        Pairs of nodes that are neighbours; None: those of the ring.
    preset : {"default", "paper-printed"}
        Convention of the Fourier features, for measures that need them.
    step : float
        Time between two samples of runs that have no times.
    """

    def __init__(
        self,
        names: Sequence[str] = ("order",),
        *,
        pairs: ArrayLike | None = None,
        preset: str = "default",
        step: float = 1.0,
    ) -> None:
        self.names = names
        self.pairs = pairs
        self.preset = preset
        self.step = step

    def measure(self, run: SignalRun) -> list[float]:
        """Return the numbers of one run."""
        settings = Features.model_validate({"preset": self.preset})
        u = np.asarray(run.u, dtype=np.float64)
        w = np.imag(hilbert(u - u.mean(axis=0), axis=0)) if run.w is None else run.w
        measured = MeasuredRun(
            t=np.asarray(run.t, dtype=np.float64),
            u=u,
            w=np.asarray(w, dtype=np.float64),
            features=measure_signals(run.t, u, **settings.options()),
            settings=settings,
            distance=float("nan"),
            pairs=None if self.pairs is None else np.asarray(self.pairs),
        )
        return [float(x) for one in self._measures() for x in one.compute(measured)]

    def _measures(self) -> list[Any]:
        if isinstance(self.names, str) or not len(self.names):
            raise BadInput(f'names is {self.names!r}; a list of measures is needed, as ["order"]')
        if "distance" in self.names:
            raise BadInput('names: "distance" needs the ball of initial states of a job')
        for name in self.names:
            check_name("names", "a measure", name, {**MEASURES, **OTHER_NAMES})
        return measures([n for name in self.names for n in OTHER_NAMES.get(name, (name,))])

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Return the names of the columns, those of a store's scalars."""
        settings = Features()
        labels = [label for one in self._measures() for label in one.labels(settings)]
        return np.array(labels, dtype=object)
