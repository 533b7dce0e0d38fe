r"""How many classes do runs hold: gap statistic, silhouette and stability for k = 1 .. 8.

All three look at Ward's clusters of points scaled to [0, 1].

- Gap statistic: ``Gap(k) = <log W*(k)> - log W(k)``, W the sum of squared distances from the
  centroids, W* that of points that are uniform in the box along the principal axes. The number is
  the smallest k with Gap(k) >= Gap(k+1) - s(k+1). Tibshirani, Walther, Hastie 2001,
  doi:10.1111/1467-9868.00293.
- Silhouette: mean of (b - a) / max(a, b), a and b the mean distances to the own and to the nearest
  other cluster, for k > 1. Rousseeuw 1987, doi:10.1016/0377-0427(87)90125-7.
- Stability: mean adjusted Rand index between the clusters of two random subsets of two thirds, on
  the runs that both hold.

The answer is the number of the silhouette. It is 1 if the gap statistic says 1, which stops too
early where few points make classes of unequal width, unless the silhouette is strong, 0.7 or more
(Kaufman, Rousseeuw 1990, doi:10.1002/9780470316801), and stability is not 1.

Points far from all others but few are no class: they are set apart first. If the others then fill
less than a tenth of the range of all, what is left between them is no class: only k = 1 is tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from chimera_hpc.classify import tree
from chimera_hpc.classify.agreement import rand_index
from chimera_hpc.classify.tree import Floats, Integers

MOST = 8
"""Largest number of classes that is tried."""
SMALLEST = 0.05
"""Least share of the runs that makes a class."""
_FAR = 5.0
"""Distance to the nearest runs beyond which a run is set apart, in those of nine tenths of all."""
_ALIKE = 0.1
"""Share of the range of all runs: where others lie apart, runs within it are one state."""
_REFERENCES = 20
_DRAWS = 10
_STABLE = 0.9
_TIE = 0.005
_CLEAR = 0.5
"""Mean silhouette from which clusters are apart."""
_STRONG = 0.7
"""Mean silhouette from which clusters are a strong structure (Kaufman, Rousseeuw 1990)."""
_MOST_POINTS = 1000


@dataclass(frozen=True)
class ClassNumber:
    """Three answers, and the numbers behind them; arrays over k = 1, 2, ..."""

    gap: Floats
    gap_error: Floats
    silhouette: Floats
    """NaN for k = 1."""
    stability: Floats
    n_runs: int
    n_apart: int
    """Runs that were set apart."""

    @property
    def by_gap(self) -> int:
        """The smallest k whose gap is not below the next one less its error."""
        enough = np.flatnonzero(self.gap[:-1] >= self.gap[1:] - self.gap_error[1:])
        return int(enough[0]) + 1 if enough.size else len(self.gap)

    @property
    def by_silhouette(self) -> int:
        """The k with the largest silhouette, 1 if none is clear."""
        best = int(np.nanargmax(self.silhouette)) if len(self.silhouette) > 1 else 0
        return best + 1 if self.silhouette[best] >= _CLEAR else 1

    @property
    def by_stability(self) -> int:
        """The largest k > 1 whose clusters come again as well as any, 1 if none do."""
        best = float(self.stability[1:].max(initial=0.0))
        if best < _STABLE:
            return 1
        return int(np.flatnonzero(self.stability[1:] >= best - _TIE).max()) + 2

    @property
    def answer(self) -> int:
        """The k of the silhouette; 1 if the gap statistic says so and the silhouette is weak."""
        k = self.by_silhouette
        strong = self.silhouette[k - 1] >= _STRONG and self.by_stability > 1
        return k if self.by_gap > 1 or strong else 1

    @property
    def sentence(self) -> str:
        """The answer in words."""
        return self.said()

    def said(self, what: str = "runs") -> str:
        """Return the answer in words, of `what`."""
        k, n = self.answer, self.n_runs - self.n_apart
        each = (
            f"gap statistic {self.by_gap}, silhouette {self.by_silhouette}, "
            f"stability {self.by_stability}"
        )
        lie = "lies" if self.n_apart == 1 else "lie"
        apart = f"; {self.n_apart} {lie} apart" if self.n_apart else ""
        if k == 1:
            return f"{n} of {self.n_runs} {what} look like one state{apart} ({each})"
        return f"{n} of {self.n_runs} {what} look like {k} classes{apart} ({each})"


def class_number(points: Floats, seed: int = 0, least: ArrayLike = 0.0) -> ClassNumber:
    """Judge how many classes points (n, d), one a run, hold; `least` as in `tree.limits`.

    Of more than 1,000 points a random 1,000 are judged. The same points give the same answer.
    """
    rng = np.random.default_rng(seed)
    chosen = points[np.lexsort(points.T)]
    if len(chosen) > _MOST_POINTS:
        chosen = chosen[np.sort(rng.choice(len(chosen), _MOST_POINTS, replace=False))]
    apart = far_from_others(chosen, least)
    kept = chosen[~apart]
    scaled = tree.scale(kept, tree.limits(kept, least))
    alike = apart.any() and bool((np.ptp(kept, axis=0) <= _ALIKE * np.ptp(chosen, axis=0)).all())
    most = 1 if alike else max(1, min(MOST, len(np.unique(scaled, axis=0)), len(scaled) - 1))
    labels = _cuts(scaled, most)
    gap, error = _gap(scaled, labels, rng)
    return ClassNumber(
        gap=gap,
        gap_error=error,
        silhouette=_silhouettes(scaled, labels),
        stability=_stability(scaled, most, rng),
        n_runs=len(chosen),
        n_apart=int(apart.sum()),
    )


def far_from_others(points: Floats, least: ArrayLike = 0.0) -> NDArray[np.bool_]:
    """Tell which points (n, d) have fewer neighbours than a class has members."""
    scaled = tree.scale(points, tree.limits(points, least))
    members = max(3, int(np.ceil(SMALLEST * len(scaled))))
    if len(scaled) <= 2 * members:
        return np.zeros(len(scaled), dtype=np.bool_)
    distances: Floats = np.asarray(cKDTree(scaled).query(scaled, k=members)[0])
    reach = distances[:, -1]
    far: NDArray[np.bool_] = reach > _FAR * max(float(np.quantile(reach, 0.9)), 1e-9)
    few = np.count_nonzero(far) <= 2 * members
    return far if few else np.zeros_like(far)


def _cuts(scaled: Floats, most: int) -> list[Integers]:
    """Return the labels of Ward's clusters for k = 1 .. most."""
    grown = tree.grow(scaled, "ward")
    return [tree.cut(grown, k) for k in range(1, most + 1)]


def _log_within(scaled: Floats, labels: Integers) -> float:
    """Return log W, the sum of squared distances from the centroids."""
    total = 0.0
    for label in np.unique(labels):
        members = scaled[labels == label]
        total += float(np.square(members - members.mean(axis=0)).sum())
    return float(np.log(max(total, 1e-300)))


def _gap(scaled: Floats, labels: list[Integers], rng: np.random.Generator) -> tuple[Floats, Floats]:
    centred = scaled - scaled.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    turned = centred @ axes.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    found = np.empty((_REFERENCES, len(labels)))
    for row in found:
        uniform = rng.uniform(low, high, turned.shape)
        row[:] = [_log_within(uniform, made) for made in _cuts(uniform, len(labels))]
    own = np.array([_log_within(scaled, made) for made in labels])
    return found.mean(axis=0) - own, found.std(axis=0) * np.sqrt(1.0 + 1.0 / _REFERENCES)


def _silhouettes(scaled: Floats, labels: list[Integers]) -> Floats:
    distances: Floats = cdist(scaled, scaled)
    return np.array([np.nan, *(float(_silhouette(distances, k).mean()) for k in labels[1:])])


def silhouettes(scaled: Floats, labels: Integers) -> Floats:
    """Return the silhouette of each point (n,) in clusters 0, 1, ...; NaN for a single cluster."""
    if labels.max(initial=0) == 0:
        return np.full(len(labels), np.nan)
    return _silhouette(cdist(scaled, scaled), labels)


def _silhouette(distances: Floats, label: Integers) -> Floats:
    """Return the silhouette of each point (n,); 0 for one that is alone."""
    member = (label[:, None] == np.arange(label.max() + 1)).astype(np.float64)
    sums, sizes = distances @ member, member.sum(axis=0)
    alone = sizes[label] == 1.0
    own = sums[member > 0.0] / np.where(alone, 1.0, sizes[label] - 1.0)
    other = np.where(member > 0.0, np.inf, sums / sizes).min(axis=1)
    return np.where(alone, 0.0, (other - own) / np.maximum(np.maximum(own, other), 1e-300))


def _stability(scaled: Floats, most: int, rng: np.random.Generator) -> Floats:
    n = len(scaled)
    found = np.ones((_DRAWS, most))
    for row in found:
        halves = [np.sort(rng.choice(n, max(2, 2 * n // 3), replace=False)) for _ in range(2)]
        both, *places = np.intersect1d(halves[0], halves[1], return_indices=True)
        cuts = [_cuts(scaled[half], most) for half in halves]
        for k in range(1, most if len(both) else 0):
            first, second = (cut[k][place] for cut, place in zip(cuts, places, strict=True))
            row[k] = rand_index(first, second)
    stable: Floats = found.mean(axis=0)
    return stable
