"""Many recordings: found on the disk, measured, clustered among themselves or judged."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify import tree
from chimera_hpc.classify.class_number import class_number, far_from_others, silhouettes
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.conventions import preset_settings
from chimera_hpc.recordings.alike import copies, differences
from chimera_hpc.recordings.columns import some_of
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


class Sources(NamedTuple):
    """Files of recordings, and a line for each folder of which others were left out."""

    files: list[Path]
    left_out: list[str]


def recording_files(words: Sequence[str | Path], but: Sequence[Path] = ()) -> Sources:
    """Return the files that words name: files, folders of files, and patterns such as ``*.csv``.

    Files of a folder come in the order of their names, those that begin with a dot are left out.
    A folder that is a Zarr store is a recording. A file that two words name comes once; those of
    `but`, files that other options name, come only if a word is their path. Raises BadInput for a
    word that names no file.
    """
    found: dict[str, Path] = {}
    left_out = []
    options = {os.path.abspath(path) for path in but}
    for word in words:
        files, left = _named_by(word)
        if files != [Path(word)]:
            left += [path for path in files if os.path.abspath(path) in options]
            files = [path for path in files if path not in left]
        if not files:
            raise BadInput(f"{word}: no recording in this folder{_deeper(word)}")
        if left:
            names = sorted(path.name for path in left)
            left_out.append(f"{word}: {some_of(names, 'file')} left out: no recordings")
        for path in files:
            found.setdefault(os.path.abspath(path), path)
    return Sources(list(found.values()), left_out)


def _named_by(word: str | Path) -> tuple[list[Path], list[Path]]:
    """Return the files of one word, and those of its folder whose names are not of recordings."""
    path = Path(word)
    if path.is_dir() and not is_zarr(path):
        seen = [one for one in sorted(path.iterdir()) if not one.name.startswith(".")]
        files = [one for one in seen if (is_zarr if one.is_dir() else known_ending)(one)]
        return files, [one for one in seen if one not in files and not one.is_dir()]
    if glob.has_magic(str(word)) and not path.exists():
        files = [Path(name) for name in sorted(glob.glob(str(word), recursive=True))]
        if not files:
            raise BadInput(f"{word}: no file matches")
        return files, []
    return [path], []


def _deeper(word: str | Path) -> str:
    inner = Path(word).is_dir() and any(one.is_dir() for one in Path(word).iterdir())
    return f"; '{word}/*/*' names those in its folders" if inner else ""


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
    warnings: tuple[str, ...] = ()
    """What speaks against the comparison, and which files of folders were left out; a line each."""

    @property
    def triplets(self) -> NDArray[np.float64]:
        """V_theta, V_a, V_Omega, shape (n, 3)."""
        return np.array([one.found.triplet for one in self.files])


def measure_files(
    sources: Sources,
    how: Treatment,
    settings: Features,
    judge: Judge | None,
    clusters: Clusters = "auto",
) -> Collection:
    """Measure recordings, then judge them by an atlas or cluster them among themselves.

    Raises BadInput, which begins with the path of the first file that cannot be measured.
    """
    files = tuple(_measured(sources.files, how, settings, judge))
    made = _judged(files) if judge is not None else _clustered(files, clusters)
    doubts = [] if judge is not None else differences(files)
    return replace(made, warnings=(*sources.left_out, *copies(files), *doubts))


def _measured(
    paths: Sequence[Path], how: Treatment, settings: Features, judge: Judge | None
) -> Iterator[Recorded]:
    for number, path in enumerate(paths, start=1):
        try:
            yield measure_file(path, how, settings, judge)
        except BadInput as error:
            where = f" (file {number} of {len(paths)}; none is classified)"
            raise BadInput(f"{error}{where if len(paths) > 1 else ''}") from None


def _judged(files: tuple[Recorded, ...]) -> Collection:
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
        attribute `sentence` says how many classes there are, `warnings` what speaks against the
        comparison: copies, other numbers of nodes, other units, files of a folder left out.

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
    sources = recording_files(words, how.files)
    return as_dataset(measure_files(sources, how, settings, judge, clusters))


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
        attrs={"sentence": made.sentence, "warnings": list(made.warnings)},
    )


def _values(one: Recorded) -> list[float]:
    amplitude, frequency = _medians(one)
    return [*one.found.triplet, frequency, amplitude, one.found.samples_a_period]


def _medians(one: Recorded) -> tuple[float, float]:
    """Return the medians over the nodes of amplitude and frequency."""
    features = one.found.features
    return float(np.median(features.amplitude)), float(np.median(features.frequency))
