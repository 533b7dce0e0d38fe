"""Atlases of other sweeps: found on the disk, read from their stores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.reduction.conventions import OWN, stored_reduction
from chimera_hpc.reduction.results import read_results
from chimera_hpc.store.reduction import sibling
from chimera_hpc.store.store import Store


def load_atlas(folder: str | Path, convention: str = OWN) -> Atlas:
    """Return the atlas that the reduction of a sweep's folder has stored.

    Its ``classify`` judges new triplets (V_theta, V_a, V_Omega): see there for the rule, and for
    the distance to the nearest training point as a measure of confidence. With a convention, the
    atlas is that of the sweep's triplets under it.

    Raises
    ------
    BadInput
        No store in the folder, or it has not been reduced.
    """
    stored = stored_reduction(Path(folder), convention)
    return Atlas.from_arrays(stored.arrays, stored.attributes)


def atlases_of(
    folder: Path, names: Sequence[str], say: Callable[[str], None], convention: str = OWN
) -> dict[str, Atlas]:
    """Load the atlases that a job names, from folders next to the sweep's own or from paths."""
    found: dict[str, Atlas] = {}
    for name in names:
        place = sibling(folder, name)
        try:
            atlas = load_atlas(place, convention)
        except BadInput as error:
            say(f"atlas {name}: {error}")
            continue
        if not atlas.names:
            say(f"atlas {name}: {place} has no classes")
        else:
            found[name] = atlas
            _warn_of_model(folder, place, f"atlas {name}", say)
    return found


def _warn_of_model(folder: Path, place: Path, name: str, say: Callable[[str], None]) -> None:
    ours, theirs = (Store.open(one / "store.zarr").sweep.model for one in (folder, place))
    if ours != theirs:
        say(f"{name}: its runs are of the model {theirs}, these of {ours}: its classes and their "
            "names are those of another system")  # fmt: skip


def curves_beside(
    folder: Path, names: Sequence[str], say: Callable[[str], None], convention: str = OWN
) -> dict[str, dict[str, Any]]:
    """Return ``curves`` of other sweeps' results.json by the names of the sweeps."""
    found = {}
    for name in names:
        place = sibling(folder, name) / convention / "results.json"
        try:
            found[name] = read_results(place)["curves"]
        except BadInput as error:
            say(f"reduction.beside: {name}: {error}")
    return found
