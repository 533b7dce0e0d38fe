"""Many recordings: found on the disk, measured, clustered among themselves or judged."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify import tree
from chimera_hpc.classify.class_number import class_number, far_from_others, silhouettes
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.conventions import preset_settings
from chimera_hpc.recordings.file import Recorded, Treatment, measure_file
from chimera_hpc.recordings.judge import Judge
from chimera_hpc.recordings.read import is_zarr, known_ending

if TYPE_CHECKING:
    import xarray as xr

Clusters = int | Literal["auto"]
FEWEST = 10
"""Oscillating recordings from which their classes are counted."""
LEAST = 0.05
"""Smallest range of V_theta that is stretched to [0, 1], and those of V_a and V_Omega as shares of
the amplitude and of the frequency: what varies less is noise, and makes no classes."""
QUANTITIES = ("V_theta", "V_a", "V_Omega", "frequency", "amplitude", "samples_per_period")


def recording_files(words: Sequence[str | Path]) -> list[Path]:
    """Return the files that words name: files, folders of files, and patterns such as ``*.csv``.

    Files of a folder come in the order of their names, those that begin with a dot are left out.
    A folder that is a Zarr store is a recording. Raises BadInput for a word that names no file.
    """
    found: dict[Path, None] = {}
    for word in words:
        path = Path(word)
        if path.is_dir() and not is_zarr(path):
            files = list(_files_in(path))
            if not files:
                raise BadInput(f"{path}: no recording in this folder")
        elif glob.has_magic(str(word)) and not path.exists():
            files = [Path(name) for name in sorted(glob.glob(str(word), recursive=True))]
            if not files:
                raise BadInput(f"{word}: no file matches")
        else:
            files = [path]
        found |= dict.fromkeys(files)
    return list(found)


def _files_in(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if not path.name.startswith(".") and (known_ending(path) or is_zarr(path)):
            yield path


@dataclass(frozen=True, eq=False)
class Collection:
    """Recordings with a class each; n recordings."""

    files: tuple[Recorded, ...]
    names: tuple[str | None, ...]
    """Class of each recording: of the clusters or of the atlas, ``steady``, ``no_window``; None."""
    confidence: NDArray[np.float64]
    """(n,): by an atlas as of a single recording; in a cluster the silhouette, 0 to 1; NaN for a
    single cluster and for a recording without a class."""
    sentence: str
    """How many classes there are, in words; empty with an atlas."""

    @property
    def triplets(self) -> NDArray[np.float64]:
        """V_theta, V_a, V_Omega, shape (n, 3)."""
        return np.array([one.found.triplet for one in self.files])


def measure_files(
    paths: Sequence[Path],
    how: Treatment,
    settings: Features,
    judge: Judge | None,
    clusters: Clusters = "auto",
) -> Collection:
    """Measure recordings, then judge them by an atlas or cluster them among themselves.

    Raises BadInput, which begins with the path of the first file that cannot be measured.
    """
    files = tuple(measure_file(path, how, settings, judge) for path in paths)
    if judge is None:
        return _clustered(files, clusters)
    verdicts = [one.found.verdict for one in files]
    names = tuple(one.found.name for one in files)
    sure = [np.nan if verdict is None else verdict.confidence for verdict in verdicts]
    return Collection(files, names, np.array(sure), "")


def _clustered(files: tuple[Recorded, ...], clusters: Clusters) -> Collection:
    from chimera_hpc.pipeline.classes import ChimeraClasses

    triplets = np.array([one.found.triplet for one in files])
    known = np.flatnonzero(np.isfinite(triplets).all(axis=1))
    n, kept, sentence = clusters, known, f"{len(known)} of {len(files)} recordings oscillate"
    sizes = np.array([[1.0, *_medians(files[i])] for i in known]).reshape(-1, 3)
    least = LEAST * np.median(sizes, axis=0) if len(known) else np.zeros(3)
    if n == "auto":
        n, kept, sentence = _counted(triplets, known, least)
    elif len(known) < n:
        raise BadInput(f"--clusters {n}: {sentence}")
    names: list[str | None] = [one.found.name for one in files]
    confidence = np.full(len(files), np.nan)
    if len(kept):
        made = ChimeraClasses(n, least=least).fit(triplets[kept])
        sure = silhouettes(tree.scale(triplets[kept], made.scaler_), made.labels_)
        confidence[kept] = np.maximum(sure, 0.0)
        for i, label in zip(kept.tolist(), made.labels_.tolist(), strict=True):
            names[i] = made.names_[label]
    return Collection(files, tuple(names), confidence, sentence)


def _counted(
    triplets: NDArray[np.float64], known: NDArray[np.int64], least: NDArray[np.float64]
) -> tuple[int, NDArray[np.int64], str]:
    """Return the number of classes, the recordings that are in one, and both in words."""
    if len(known) < FEWEST:
        few = f"{len(known)} oscillating recordings are too few to count classes"
        return 1, known, f"{few}: {FEWEST} are needed, or --clusters N"
    found = class_number(triplets[known], least=least)
    apart = far_from_others(triplets[known], least)
    return found.answer, known[~apart], found.said("recordings")


def classify_recordings(
    files: str | Path | Sequence[str | Path],
    *,
    atlas: str | Path | None = None,
    clusters: Clusters = "auto",
    links: str | Path | None = None,
    preset: str | None = None,
    settings: Features | None = None,
    **treatment: Any,
) -> xr.Dataset:
    """Variations and classes of recordings, as the command ``classify FILE...`` gives them.

    Parameters
    ----------
    files : path, pattern or folder, or a sequence of them
        As the command takes them; see `recording_files`.
    atlas : path, optional
        A reduced sweep whose classes judge. Otherwise the recordings are clustered among
        themselves.
    clusters : int or "auto"
        Number of clusters; "auto" counts them, one included.
    links : path, optional
        File of a network, over whose links the variations are taken.
    preset : {"default", "paper-printed"}, optional
    settings : Features, optional
        The table [features] by which recordings are measured; default: those of atlas or preset.
    **treatment
        Fields of `Treatment`: step, order, span, bridge, scale, rescale, lowpass, ring.

    Returns
    -------
    xarray.Dataset
        ``value(recording, quantity)`` with the quantities V_theta, V_a, V_Omega, frequency and
        amplitude (medians over the nodes), samples_per_period; ``class(recording)``, empty for
        none, ``confidence(recording)`` and ``status(recording)``; the files along `recording`. The
        attribute `sentence` says how many classes there are.

    Raises
    ------
    BadInput
        A file that cannot be read or measured, or options that contradict each other.
    """
    if atlas is not None and clusters != "auto":
        raise BadInput("clusters and atlas: one of them")
    words = [files] if isinstance(files, str | Path) else list(files)
    preset_settings(preset or "default")
    judge = None if atlas is None else Judge.load(Path(atlas), preset)
    if settings is None:
        by_preset = Features.model_validate({"preset": preset or "default"})
        settings = by_preset if judge is None else judge.settings
    how = Treatment(links=None if links is None else Path(links), **treatment)
    return as_dataset(measure_files(recording_files(words), how, settings, judge, clusters))


def as_dataset(made: Collection) -> xr.Dataset:
    """Return recordings as a dataset, see `classify_recordings`."""
    import xarray as xr

    files = [str(one.path) for one in made.files]
    status = [one.found.features.status.name.lower() for one in made.files]
    return xr.Dataset(
        {
            "value": (("recording", "quantity"), np.array([_values(one) for one in made.files])),
            "class": ("recording", np.array([name or "" for name in made.names])),
            "confidence": ("recording", made.confidence),
            "status": ("recording", np.array(status)),
        },
        coords={"recording": files, "quantity": list(QUANTITIES)},
        attrs={"sentence": made.sentence},
    )


def _values(one: Recorded) -> list[float]:
    amplitude, frequency = _medians(one)
    return [*one.found.triplet, frequency, amplitude, one.found.samples_a_period]


def _medians(one: Recorded) -> tuple[float, float]:
    """Return the medians over the nodes of amplitude and frequency."""
    features = one.found.features
    return float(np.median(features.amplitude)), float(np.median(features.frequency))
