"""The group `reduction` of a store: what was made of the points, replaced as a whole."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import ArrayLike, NDArray
from zarr.codecs import Crc32cCodec, ZstdCodec

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import remove_leftovers, sync_folder, sync_tree, temporary_name
from chimera_hpc.store.ledger import SEPARATOR
from chimera_hpc.store.template import REDUCTION as NAME

Variable = tuple[tuple[str, ...], ArrayLike] | tuple[tuple[str, ...], ArrayLike, Mapping[str, Any]]
"""Names of the dimensions, values, and attributes if there are any (as xarray takes a variable)."""


@dataclass(frozen=True)
class StoredReduction:
    """What a reduction stored."""

    arrays: dict[str, NDArray[Any]]
    attributes: dict[str, Any]


def sibling(folder: Path, name: str) -> Path:
    """Return the folder that a name stands for: next to the sweep's own, or a path as it is."""
    path = Path(name)
    return path if path.is_absolute() or len(path.parts) > 1 else folder.absolute().parent / name


def write_reduction(
    path: Path, variables: Mapping[str, Variable], attributes: Mapping[str, Any]
) -> None:
    """Replace the group `reduction` of the store at `path`.

    It is written under a temporary name first. Killed between the two renames, the store is without
    a reduction, which can be made again from the points; it is never with half of one.
    """
    remove_leftovers(path)
    new, old, place = temporary_name(path / NAME), temporary_name(path / "old"), path / NAME
    group = zarr.create_group(new, attributes=dict(attributes))
    for name, variable in variables.items():
        _create(group, name, variable)
    sync_tree(new)
    with contextlib.suppress(FileNotFoundError):
        os.rename(place, old)
    os.rename(new, place)
    sync_folder(path)
    shutil.rmtree(old, ignore_errors=True)


def read_reduction(path: Path) -> StoredReduction:
    """Return the stored reduction; raise BadInput when there is none yet."""
    try:
        group = zarr.open_group(path / NAME, mode="r", use_consolidated=False)
    except FileNotFoundError:
        raise BadInput(f"{path}: not reduced yet; `reduce` does it") from None
    arrays = {name: np.asarray(array[...]) for name, array in group.arrays()}
    return StoredReduction(arrays, dict(group.attrs))


def _create(group: zarr.Group, name: str, variable: Variable) -> None:
    dimensions, values, *more = variable
    data = np.asarray(values)
    if data.dtype.kind not in "biuf":
        raise TypeError(f"reduction/{name}: {data.dtype} has no settled type in Zarr v3")
    attributes = {"units": "1", "long_name": name.replace("_", " "), **(more[0] if more else {})}
    group.create_array(
        name,
        data=data,
        chunks=tuple(max(1, n) for n in data.shape),
        dimension_names=dimensions,
        attributes=attributes,
        fill_value=np.nan if data.dtype.kind == "f" else 0,
        compressors=[ZstdCodec(level=3), Crc32cCodec()],
        chunk_key_encoding={"name": "default", "separator": SEPARATOR},
        config={"write_empty_chunks": True},
    )
