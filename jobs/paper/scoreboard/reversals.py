"""W(Q_r) read in two more ways: links drawn with replacement, and against the norm of s.

``PYTHONPATH=jobs/paper python -m scoreboard.reversals results/paper`` prints both for the jobs
robustness-1 and robustness-2 and draws the second. (The paper, app. E and fig. 19, says neither
how links are drawn nor why one orientation is more robust.)

The orientation enters the equations through the divergence s = B1 1 alone, as b s in
dw/dt = b s + c w + L0 u. So if W depends on the orientation through the size of b s only, W against
|s|^2 is one curve for both orientations.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.classify.robustness import wilson_interval
from chimera_hpc.job.models import build
from chimera_hpc.plot.robustness import Band, robustness
from chimera_hpc.plot.style import save
from chimera_hpc.reduction.atlases import load_atlas
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.store import Store
from scoreboard.evidence import Evidence

Array = NDArray[np.float64]

JOBS = {"robustness-1": "diagonal", "robustness-2": "orientation2"}
"""The two jobs and the sweeps whose classes judge them."""
N_LINKS = 650
"""Links of the ring of 50 nodes with P = 13."""
N_BINS = 12


def links_turned(n_links: int, draws: int) -> Array:
    """Distribution of the number of reversed links after drawing links with replacement.

    Each drawn link is turned round, one that is drawn twice points as before:
    p_{m+1}(k) = p_m(k-1) (N1 - k + 1)/N1 + p_m(k+1) (k + 1)/N1. Given k, all sets of k links are
    equally probable, so W with replacement is the mean of W(k) over this distribution.

    Returns
    -------
    (n_links + 1,)
        Probability of k = 0 ... N1 reversed links.
    """
    k = np.arange(n_links + 1)
    p = np.zeros(n_links + 1)
    p[0] = 1.0
    for _ in range(draws):
        up, down = p * (n_links - k) / n_links, p * k / n_links
        p = np.concatenate([[0.0], up[:-1]]) + np.concatenate([down[1:], [0.0]])
    return p


def with_replacement(x: Array, w: Array, n_links: int, draws: Sequence[int]) -> Array:
    """Return W at these numbers of draws, from W at x reversed links (linear in between)."""
    curve = np.interp(np.arange(n_links + 1), x, w)
    return np.array([links_turned(n_links, count) @ curve for count in draws])


@dataclass(frozen=True)
class Norms:
    """|s|^2 and the class of every run of a job, each (n,)."""

    norm: Array
    is_chimera: NDArray[np.bool_]

    @classmethod
    def read(cls, folder: Path, job: str, judge: str) -> Norms:
        """Build every ring again and judge its run by the atlas."""
        store = Store.open(folder / job / STORE_NAME)
        scalars = store.scalars()
        done = store.ledger()["status"] == Status.DONE
        triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
        named = np.array(load_atlas(folder / judge).classify(triplets).name)
        rings: Iterator[Any] = (build(store.sweep, store.points.row(i)) for i in range(len(done)))
        norm = np.array([float((ring.topology.divergence**2).sum()) for ring in rings])
        return cls(norm, done & (named == "chimera"))

    def band(self, n_bins: int = N_BINS) -> Band:
        """Return W in bins of |s|^2 that hold as many runs each."""
        parts = np.array_split(np.argsort(self.norm, kind="stable"), n_bins)
        hits = np.array([self.is_chimera[part].sum() for part in parts])
        trials = np.array([len(part) for part in parts])
        low, high = wilson_interval(hits, trials)
        return Band([self.norm[part].mean() for part in parts], hits / trials, low, high)


def main(arguments: Sequence[str]) -> int:
    """Print both readings; draw W against |s|^2 next to the jobs."""
    folder = Path(arguments[0])
    evidence = Evidence(folder)
    runs = {job: Norms.read(folder, job, judge) for job, judge in JOBS.items()}
    bands = {}
    for number, (job, each) in enumerate(runs.items(), 1):
        entry = evidence.value(job, "curves/robustness")
        curve = entry["by"][entry["judge"]]
        draws = (15, 40, 75, 150, 325)
        again = with_replacement(np.array(curve["x"]), np.array(curve["fraction"]), N_LINKS, draws)
        words = ", ".join(f"{w:.2f} at {m}" for m, w in zip(draws, again, strict=True))
        print(f"{job}: W with replacement {words}")
        print(f"{job}: |s|^2 from {each.norm.min():.0f} to {each.norm.max():.0f}")
        band = bands[f"orientation {number}"] = each.band()
        for x, w, low, high in np.stack([band.x, band.fraction, band.low, band.high], axis=1):
            print(f"    |s|^2 about {x:6.0f}: W = {w:.2f} ({low:.2f} to {high:.2f})")
    figure: Figure = robustness(bands, label=r"$|s|^2$")
    save(figure, folder / "robustness-norm")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
